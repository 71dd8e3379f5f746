// Camera with a position and three unit axes. It starts as the camera of the film.
class Camera {
  constructor() {
    this.reset();
  }

  reset() {
    const { eye, forward, up } = scene.camera;
    const { center } = scene.bounds;
    [this.eye, this.forward, this.up] = [eye, normalized(forward), normalized(up)];
    this.right = normalized(cross(this.forward, this.up));
    // Orbit around a point ahead, at the distance of the scene's center.
    const way = dot(add(center, this.eye, -1), this.forward);
    this.distance = Math.max(way, 0.1 * scene.bounds.radius);
  }

  // Half the width and height of the picture at a distance of 1, or in meters for parallel rays.
  half(aspect) {
    const { halfWidth, halfHeight } = scene.camera;
    const height = Math.max(halfHeight, halfWidth / aspect);
    return [height * aspect, height];
  }

  clipFromWorld([x, y]) {
    const { radius, center } = scene.bounds;
    const r = this.right, u = this.up, f = this.forward, e = this.eye;
    const way = Math.hypot(...add(center, e, -1)) + radius;
    const near = Math.max(scene.camera.near, 5e-4 * Math.min(radius, 100));
    const far = Math.max(scene.camera.far > 0 ? Math.min(scene.camera.far, 1.1 * way) : 1.1 * way, 2 * near);
    const position = [-dot(r, e), -dot(u, e), dot(f, e)];
    const row = (axis, last, scale) => [axis[0] * scale, axis[1] * scale, axis[2] * scale, last * scale];
    const X = row(r, position[0], 1 / x), Y = row(u, position[1], 1 / y);
    const back = [-f[0], -f[1], -f[2], position[2]];
    const [a, b] = scene.camera.parallel ? [-2 / (far - near), -(far + near) / (far - near)]
      : [-(far + near) / (far - near), (-2 * far * near) / (far - near)];
    const Z = back.map((value, k) => a * value + (k === 3 ? b : 0));
    const W = scene.camera.parallel ? [0, 0, 0, 1] : back.map((value) => -value);
    return new Float32Array([0, 1, 2, 3].flatMap((k) => [X[k], Y[k], Z[k], W[k]]));
  }

  // Turns by two angles: about the vertical axis, and up. Horizons become level.
  turn(yaw, pitch) {
    const f = this.forward;
    const height = Math.asin(Math.max(-1, Math.min(1, f[1]))) + pitch;
    const angle = Math.atan2(f[0], -f[2]) - yaw;
    const limited = Math.max(-1.55, Math.min(1.55, height));
    this.forward = [Math.cos(limited) * Math.sin(angle), Math.sin(limited), -Math.cos(limited) * Math.cos(angle)];
    this.right = normalized(cross(this.forward, [0, 1, 0]));
    this.up = cross(this.right, this.forward);
  }

  orbit(yaw, pitch) {
    const pivot = add(this.eye, this.forward, this.distance);
    this.turn(yaw, pitch);
    this.eye = add(pivot, this.forward, -this.distance);
  }

  // Moves along the three axes [m]. Orbits approach their pivot.
  move(right, up, forward) {
    this.eye = add(add(add(this.eye, this.right, right), this.up, up), this.forward, forward);
    this.distance = Math.max(this.distance - forward, 0.02 * scene.bounds.radius);
  }
}
