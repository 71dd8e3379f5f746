// Job type for Flamenco 3 (https://flamenco.blender.org): copy this file to the folder `scripts` next to the manager.
//
// One task makes the light of the film, one task per chunk renders a part, and a last task joins the parts.
// Scene and film need absolute paths that are the same on all workers.

const JOB_TYPE = {
    label: "render2mpeg film",
    description: "Render an animated glTF scene in chunks and join them to an MPEG-2 video",
    settings: [
        { key: "scene", type: "string", subtype: "file_path", required: true,
          description: "Scene, .glb or .gltf" },
        { key: "film", type: "string", subtype: "file_path", required: true,
          description: "Video, .mpg, .mp4, .mkv, .ts, .vob or .m2v; parts and light are in the folder FILM.parts" },
        { key: "frames", type: "int32", required: true, propargs: { min: 1 },
          eval: "C.scene.frame_end - C.scene.frame_start + 1", description: "Number of frames" },
        { key: "chunk_size", type: "int32", default: 10, propargs: { min: 1 }, visible: "submission",
          description: "Frames per chunk" },
        { key: "options", type: "string", default: "", visible: "submission",
          description: "Film options, separated by spaces, such as --size 1280x720 --qscale 4" },
        { key: "program", type: "string", default: "render2mpeg", visible: "submission",
          description: "Path of the program, or its name in PATH" },
    ],
};

function compileJob(job) {
    const settings = job.settings;
    const parts = `${settings.film}.parts`;
    const filmOptions = [settings.scene, "--frames", String(settings.frames), "--light", `${parts}/film.light`]
        .concat(shellSplit(settings.options || ""));

    // Dependencies come before addTask, which copies the task.
    const light = author.Task("light", "misc");
    light.addCommand(author.Command("make-directory", { path: parts }));
    light.addCommand(programCommand(settings, ["plan"].concat(filmOptions)));
    job.addTask(light);

    const join = author.Task("join", "misc");
    const files = [];
    for (let chunk = 0; chunk * settings.chunk_size < settings.frames; chunk++) {
        const file = `${parts}/part_${chunk}.m2v`;
        const render = author.Task(`render-${chunk}`, "misc");
        render.addCommand(programCommand(settings, ["render"].concat(filmOptions, [
            "--chunk", String(settings.chunk_size), "--chunk-index", String(chunk),
            "-o", file, "-q", "--resume", "--overwrite",
        ])));
        render.addDependency(light);
        job.addTask(render);
        join.addDependency(render);
        files.push(file);
    }

    join.addCommand(programCommand(settings, ["join"].concat(files, ["-o", settings.film, "--overwrite"])));
    job.addTask(join);
}

function programCommand(settings, args) {
    return author.Command("exec", { exe: settings.program, args: args });
}
