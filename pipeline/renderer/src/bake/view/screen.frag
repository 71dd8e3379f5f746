out vec4 shown;

uniform sampler2D picture;
uniform int factor;
uniform float gamma;

float transfer(float v) {
  if (gamma > 0.0) return pow(v, 1.0 / gamma);
  return v <= 0.0031308 ? 12.92 * v : 1.055 * pow(v, 1.0 / 2.4) - 0.055;
}

void main() {
  // Average the samples of a pixel in display light, then apply the transfer curve.
  vec3 sum = vec3(0.0);
  for (int y = 0; y < factor; y++) {
    for (int x = 0; x < factor; x++) sum += texelFetch(picture, ivec2(gl_FragCoord.xy) * factor + ivec2(x, y), 0).rgb;
  }
  vec3 v = sum / float(factor * factor);
  shown = vec4(transfer(v.r), transfer(v.g), transfer(v.b), 1.0);
}
