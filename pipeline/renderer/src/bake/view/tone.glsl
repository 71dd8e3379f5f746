// Tone curve of the film, from exposed light to linear display light. The exposure of the film is in the light already.
uniform float gain;
uniform int curveKind;
uniform float white;

float unscaledFilmic(float x) {
  const float A = 0.15, B = 0.50, C = 0.10, D = 0.20, E = 0.024, F = 0.30;
  float ratio = E / F;
  return x * (A * (1.0 - ratio) * x + B * (C - ratio)) / (x * (A * x + B) + D * F);
}

float curve(float x) {
  // The operators are numbered as gamma, srgb, reinhard, extended_reinhard, filmic.
  if (curveKind <= 1) return min(x, 1.0);
  if (curveKind == 2) return 1.0 - 1.0 / (1.0 + x);
  if (curveKind == 3) return x < white ? x * (1.0 + x / (white * white)) / (1.0 + x) : 1.0;
  const float W = 11.2, GAIN = 3.1606977517308;
  return x * GAIN < W ? unscaledFilmic(GAIN * x) / unscaledFilmic(W) : 1.0;
}

// Returns linear display light. The framebuffer stores it as sRGB, so edges and blended surfaces mix as in films.
vec3 display(vec3 light) {
  vec3 x = max(light, 0.0) * gain;
  return clamp(vec3(curve(x.r), curve(x.g), curve(x.b)), 0.0, 1.0);
}

// Exposed light for linear display light, by bisection. The curves are monotonic.
float exposed(float y) {
  if (y <= 0.0) return 0.0;
  float low = 0.0, high = 12.0;
  for (int k = 0; k < 18; k++) {
    float middle = 0.5 * (low + high);
    if (curve(middle) < y) low = middle;
    else high = middle;
  }
  return high;
}

// Display light to add for a surface of opacity `alpha` in front of `behind`. Films blend layers before the tone curve:
// a bright surface is visible even if it covers little. The framebuffer keeps 1 − alpha of the light behind.
vec3 blended(vec3 light, float alpha, vec3 behind) {
  vec3 back = vec3(exposed(behind.r), exposed(behind.g), exposed(behind.b)) / gain;
  return max(display(mix(back, light, alpha)) - (1.0 - alpha) * behind, 0.0);
}
