// Sky: a gradient or an image.
uniform bool isGradient;
uniform vec3 zenith;
uniform vec3 horizon;
uniform vec3 ground;
uniform sampler2D skyImage;

vec3 skyGradient(float y) {
  return y >= 0.0 ? mix(horizon, zenith, sqrt(y)) : mix(horizon, ground, min(-y * 20.0, 1.0));
}

vec3 skyPicture(vec3 d) {
  // Rows from straight up to straight down; the middle of the image is in direction -z.
  vec2 size = vec2(textureSize(skyImage, 0));
  vec2 p = vec2(atan(d.x, -d.z) / 6.2831853 + 0.5, acos(clamp(d.y, -1.0, 1.0)) / 3.14159265) * size - 0.5;
  ivec2 low = ivec2(floor(p)), n = ivec2(size);
  vec2 f = p - vec2(low);
  int x0 = (low.x + n.x) % n.x, x1 = (low.x + 1) % n.x;
  int y0 = clamp(low.y, 0, n.y - 1), y1 = clamp(low.y + 1, 0, n.y - 1);
  vec3 above = mix(texelFetch(skyImage, ivec2(x0, y0), 0).rgb, texelFetch(skyImage, ivec2(x1, y0), 0).rgb, f.x);
  vec3 below = mix(texelFetch(skyImage, ivec2(x0, y1), 0).rgb, texelFetch(skyImage, ivec2(x1, y1), 0).rgb, f.x);
  return mix(above, below, f.y);
}

vec3 skyLight(vec3 d) {
  return isGradient ? skyGradient(d.y) : skyPicture(d);
}
