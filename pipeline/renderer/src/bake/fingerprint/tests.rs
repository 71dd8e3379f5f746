use super::*;
use glam::{Quat, vec3};
use render_core::Environment;
use render_core::scene::{self, Camera, Encoding, Gradient, Instance, Projection, Texture, Wrap};
use std::path::Path;

/// Index of the camera's node in [`stage`].
const CAMERA: usize = 0;
/// Index of the lamp's node in [`stage`].
const LAMP: usize = 1;
/// Index of the moving parent of the triangle's node in [`stage`].
const BODY: usize = 2;
/// Index of the deforming triangle's node in [`stage`].
const HAND: usize = 3;
/// Index of the joint's node in [`stage`].
const JOINT: usize = 4;

fn texture(code: u8, wrap: Wrap, encoding: Encoding) -> Texture {
    Texture::with_encoding(2, 1, vec![[1, 2, 3, 255], [code, 5, 6, 255]], [Wrap::Repeat, wrap], encoding)
}

fn sky(zenith: f32) -> Option<Environment> {
    Environment::gradient(Gradient { zenith: [zenith; 3], horizon: [1.0; 3], ground: [0.5; 3] })
}

fn channel(node: usize, track: Track) -> Channel {
    Channel { node, times: vec![0.0, 1.0], track, interpolation: Interpolation::Linear }
}

fn moves(node: usize, to: f32) -> Channel {
    channel(node, Track::Translation(vec![Vec3::ZERO, Vec3::X * to]))
}

/// Returns a scene with a moving camera, a lamp, and a triangle that moves and deforms.
fn stage() -> Scene {
    let node = |parent| Node { name: String::new(), parent, rest: Transform::IDENTITY };
    let slot = TextureSlot { texture: 0, uv_set: 0, transform: Some((Vec2::ZERO, 0.5, Vec2::ONE)) };
    let mesh = Mesh {
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
        normals: vec![Vec3::Z; 3],
        tangents: vec![Vec4::ONE; 3],
        uvs: [vec![Vec2::ONE; 3], vec![], vec![], vec![]],
        triangles: vec![[0, 1, 2]],
        morph_targets: vec![MorphTarget { positions: vec![Vec3::Z; 3], ..MorphTarget::default() }],
        skinning: Some(Skinning { skin: 0, per_vertex: 1, influences: vec![Influence { joint: 0, weight: 1.0 }; 3] }),
        ..Mesh::default()
    };
    let material =
        Material { base_color_texture: Some(slot), normal_texture: Some((slot, 1.0)), ..Material::default() };
    Scene {
        nodes: vec![node(None), node(None), node(None), node(Some(BODY)), node(Some(HAND))],
        meshes: vec![mesh],
        materials: vec![material],
        textures: vec![texture(4, Wrap::Repeat, Encoding::Srgb)],
        instances: vec![Instance { node: HAND, mesh: 0 }],
        skins: vec![Skin { joints: vec![JOINT], inverse_bind: vec![Affine3A::IDENTITY] }],
        morphed_nodes: vec![MorphedNode { node: HAND, weights: vec![0.5] }],
        punctual_lights: vec![PunctualLight { node: LAMP, color: Vec3::ONE, kind: PunctualKind::Point }],
        cameras: vec![Camera {
            name: "eye".into(),
            node: CAMERA,
            projection: Projection::Perspective { yfov: 0.8 },
            ..Camera::default()
        }],
        channels: vec![moves(CAMERA, 1.0), moves(BODY, 2.0), channel(HAND, Track::Weights(vec![0.0, 1.0]))],
        sky: sky(2.0),
        ..Scene::default()
    }
}

/// Returns the fingerprint of [`stage`] after `change`.
fn after(change: impl FnOnce(&mut Scene)) -> u64 {
    let mut scene = stage();
    change(&mut scene);
    fingerprint(&scene)
}

#[test]
fn a_scene_has_one_fingerprint() {
    for name in ["cornell-box/cornell-box.glb", "nave/nave.glb"] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes").join(name);
        let [first, second] = [(); 2].map(|()| fingerprint(&scene::load(&path).unwrap()));
        assert_eq!(first, second, "{name}");
    }
    assert_eq!(fingerprint(&stage()), fingerprint(&stage()));
}

/// Checks the fingerprint's value. Changing it rejects all existing files of baked light.
#[test]
fn fingerprints_are_those_of_other_machines_and_versions() {
    assert_eq!(
        format!("{:016x} {:016x}", fingerprint(&stage()), fingerprint(&Scene::default())),
        "a1f69fa936584e05 897784860d7d0e67"
    );
}

#[test]
fn cameras_names_and_films_do_not_count() {
    type Change = fn(&mut Scene);
    let changes: [(&str, Change); 12] = [
        ("camera", |s| s.cameras[0].projection = Projection::Orthographic { ymag: 1.0 }),
        ("no camera", |s| s.cameras.clear()),
        ("place of the camera", |s| s.nodes[CAMERA].rest.translation.x = 3.0),
        ("movement of the camera", |s| s.channels[0] = moves(CAMERA, 5.0)),
        ("camera at rest", |s| drop(s.channels.remove(0))),
        ("camera on the body", |s| s.nodes.push(Node { parent: Some(BODY), ..s.nodes[CAMERA].clone() })),
        ("names", |s| s.meshes[0].name = "body".into()),
        ("names of materials", |s| s.materials[0].name = "clay".into()),
        ("warnings", |s| s.warnings.push("a line".into())),
        ("length", |s| s.settings.video.frames = Some(3)),
        ("choice of the camera", |s| s.settings.camera.name = Some("eye".into())),
        ("sign of zero", |s| s.meshes[0].positions[0] = Vec3::splat(-0.0)),
    ];
    for (name, change) in changes {
        assert_eq!(after(change), fingerprint(&stage()), "{name}");
    }
}

/// Checks that the position of a camera node among the nodes has no effect, although it changes the other nodes'
/// indices.
#[test]
fn nodes_may_have_other_indices() {
    let with_camera_at = |place: usize| {
        let mut scene = stage();
        let moved = |node: usize| if node >= place { node + 1 } else { node };
        let parents = scene.nodes.iter_mut().filter_map(|node| node.parent.as_mut());
        let lists = scene.instances.iter_mut().map(|instance| &mut instance.node);
        let lists = lists.chain(scene.skins.iter_mut().flat_map(|skin| &mut skin.joints));
        let lists = lists.chain(scene.morphed_nodes.iter_mut().map(|morphed| &mut morphed.node));
        let lists = lists.chain(scene.punctual_lights.iter_mut().map(|light| &mut light.node));
        let lists = lists.chain(scene.channels.iter_mut().map(|channel| &mut channel.node));
        lists.chain(parents).for_each(|node| *node = moved(*node));
        scene.nodes.insert(place, Node { name: "new".into(), parent: None, rest: Transform::IDENTITY });
        fingerprint(&scene)
    };
    for place in 0..=stage().nodes.len() {
        assert_eq!(with_camera_at(place), fingerprint(&stage()), "{place}");
    }
}

#[test]
fn all_else_counts() {
    type Change = fn(&mut Scene);
    let changes: [(&str, Change); 41] = [
        ("position", |s| s.meshes[0].positions[1].x = 1.000_001),
        ("normal", |s| s.meshes[0].normals[2].x = 0.1),
        ("tangent", |s| s.meshes[0].tangents[0].w = -1.0),
        ("UV", |s| s.meshes[0].uvs[0][1].y = 0.0),
        ("UV set", |s| s.meshes[0].uvs.swap(0, 1)),
        ("colors", |s| s.meshes[0].colors = vec![Vec4::ONE; 3]),
        ("triangle", |s| s.meshes[0].triangles[0] = [1, 2, 0]),
        ("morph target", |s| s.meshes[0].morph_targets[0].positions[0].x = 1.0),
        ("influence", |s| s.meshes[0].skinning.as_mut().unwrap().influences[0].weight = 0.5),
        ("no skin", |s| s.meshes[0].skinning = None),
        ("not a number", |s| s.meshes[0].positions[0].x = f32::NAN),
        ("second material", |s| s.materials.push(Material::default())),
        ("color", |s| s.materials[0].base_color.x = 0.5),
        ("no texture", |s| s.materials[0].base_color_texture = None),
        ("texture of another kind", |s| s.materials[0].emission_texture = s.materials[0].base_color_texture.take()),
        ("turned texture", |s| s.materials[0].base_color_texture.as_mut().unwrap().transform = None),
        ("metallic", |s| s.materials[0].metallic = 0.5),
        ("roughness", |s| s.materials[0].roughness = 0.5),
        ("depth of normals", |s| s.materials[0].normal_texture.as_mut().unwrap().1 = 0.5),
        ("reflectance", |s| s.materials[0].dielectric_f0.x = 0.05),
        ("opacity", |s| s.materials[0].opacity = 0.5),
        ("alpha", |s| s.materials[0].alpha = Alpha::Blend),
        ("cutoff", |s| s.materials[0].alpha = Alpha::Mask { cutoff: 0.5 }),
        ("emission", |s| s.materials[0].emission.z = 1.0),
        ("sides", |s| s.materials[0].double_sided = true),
        ("unlit", |s| s.materials[0].unlit = true),
        ("texel", |s| s.textures[0] = texture(5, Wrap::Repeat, Encoding::Srgb)),
        ("wrap", |s| s.textures[0] = texture(4, Wrap::Clamp, Encoding::Srgb)),
        ("encoding", |s| s.textures[0] = texture(4, Wrap::Repeat, Encoding::Linear)),
        ("place of the body", |s| s.nodes[BODY].rest.translation.x = 3.0),
        ("parent", |s| s.nodes[HAND].parent = None),
        ("instance", |s| s.instances.push(s.instances[0])),
        ("bind", |s| s.skins[0].inverse_bind[0].translation.x = 1.0),
        ("weights", |s| s.morphed_nodes[0].weights[0] = 0.25),
        ("intensity", |s| s.punctual_lights[0].color *= 2.0),
        ("kind of light", |s| s.punctual_lights[0].kind = PunctualKind::Spot { inner: 0.1, outer: 0.2 }),
        ("place of the light", |s| s.nodes[LAMP].rest.rotation = Quat::from_rotation_x(1.0)),
        ("movement", |s| s.channels[1] = moves(BODY, 2.5)),
        ("movement of weights", |s| drop(s.channels.pop())),
        ("sky", |s| s.sky = sky(2.5)),
        ("sun", |s| s.settings.sun.angular_diameter = 5.0),
    ];
    // Check that all changes lead to different fingerprints.
    let mut found = vec![("none", fingerprint(&stage()))];
    for (name, change) in changes {
        let changed = after(change);
        if let Some((other, _)) = found.iter().find(|(_, other)| *other == changed) {
            panic!("{name} is as {other}");
        }
        found.push((name, changed));
    }
}

#[test]
fn every_part_of_a_pictured_sky_counts() {
    let sky = |texel: f32, intensity: f32, rotation: f32| {
        let texels = plane::Plane::from_fn(4, 2, |x, _| vec3(1.0, 2.0, if x == 3 { texel } else { 3.0 }));
        after(|scene| scene.sky = Environment::image(texels, intensity, rotation))
    };
    let first = sky(3.0, 1.0, 0.0);
    assert_eq!(first, sky(3.0, 1.0, -0.0));
    for other in [sky(4.0, 1.0, 0.0), sky(3.0, 2.0, 0.0), sky(3.0, 1.0, 90.0), after(|scene| scene.sky = None)] {
        assert_ne!(first, other);
    }
}
