#!/usr/bin/env node
// Runs the program of this package with the same arguments.
"use strict";

const { spawnSync } = require("node:child_process");
const { existsSync } = require("node:fs");
const path = require("node:path");

const name = process.platform === "win32" ? "render2mpeg.exe" : "render2mpeg";
const program = path.join(__dirname, "bin", `${process.platform}-${process.arch}`, name);
if (!existsSync(program)) {
    console.error(`render2mpeg: this package has no program for ${process.platform} on ${process.arch}`);
    process.exit(1);
}
const finished = spawnSync(program, process.argv.slice(2), { stdio: "inherit" });
if (finished.error) {
    console.error(`render2mpeg: ${finished.error.message}`);
    process.exit(1);
}
// A program ended by a signal has no exit code.
process.exit(finished.status === null ? 128 : finished.status);
