// Baked light: irradiance of the texels, and light of coats by direction.
uniform vec3 meanLight;
uniform sampler2D irradianceImage;

// Coats: baked light, lamps and rays (0), piecewise constant baked light (1), none (2), baked light and lamps (3).
uniform int coatMode;
uniform bool hasCoats;
uniform highp usampler2D placeImage;
uniform sampler2D constantPage;
uniform sampler2D linearPage;
uniform sampler2D quadraticPage;
uniform sampler2D octahedralPage;

// Four texels around a position in the atlas, with bilinear weights: Atlas::bilinear.
struct Blend {
  ivec2 texels[4];
  float weights[4];
};

Blend blend(vec2 position) {
  vec2 center = position - 0.5;
  ivec2 first = ivec2(floor(center + 1e-3));
  vec2 f = max(center - vec2(first), 0.0);
  // Repeat the texel if the point is at its center, because the next texel may not exist.
  ivec2 next = ivec2(f.x <= 1e-3 ? 0 : 1, f.y <= 1e-3 ? 0 : 1);
  f *= vec2(next);
  Blend b;
  b.texels = ivec2[4](first, first + ivec2(next.x, 0), first + ivec2(0, next.y), first + next);
  b.weights = float[4]((1.0 - f.x) * (1.0 - f.y), f.x * (1.0 - f.y), (1.0 - f.x) * f.y, f.x * f.y);
  return b;
}

vec3 irradiance(Blend b) {
  vec3 sum = vec3(0.0);
  for (int k = 0; k < 4; k++) sum += b.weights[k] * texelFetch(irradianceImage, b.texels[k], 0).rgb;
  return sum;
}

// Octahedral map of 8x8 directions: OctahedralMap of the crate lightfield.
vec2 folded(vec2 p) {
  return (1.0 - abs(p.yx)) * vec2(p.x < 0.0 ? -1.0 : 1.0, p.y < 0.0 ? -1.0 : 1.0);
}

vec2 toSquare(vec3 d) {
  vec3 p = d / (abs(d.x) + abs(d.y) + abs(d.z));
  return p.z >= 0.0 ? p.xy : folded(p.xy);
}

vec3 fromSquare(vec2 p) {
  float z = 1.0 - abs(p.x) - abs(p.y);
  return normalize(vec3(z >= 0.0 ? p : folded(p), z));
}

int across(int i, int j) {
  if (i < 0 || i > 7) { i = clamp(i, 0, 7); j = 7 - j; }
  if (j < 0 || j > 7) { i = 7 - i; j = clamp(j, 0, 7); }
  return i + 8 * j;
}

vec3 coefficient(sampler2D page, int index) {
  int width = textureSize(page, 0).x;
  return texelFetch(page, ivec2(index % width, index / width), 0).rgb;
}

// Light of a texel's coat in a direction: CompactPages of the crate lightfield.
vec3 compact(uint texel, vec3 d) {
  int row = int(texel & 0x0fffffffu);
  uint kind = texel >> 28;
  if (kind == 1u) return coefficient(constantPage, row);
  if (kind == 4u) {
    vec2 p = (toSquare(d) + 1.0) * 4.0 - 0.5;
    ivec2 low = ivec2(floor(p));
    vec2 f = p - vec2(low);
    int first = 64 * row;
    vec3 left = mix(coefficient(octahedralPage, first + across(low.x, low.y)),
                    coefficient(octahedralPage, first + across(low.x, low.y + 1)), f.y);
    vec3 right = mix(coefficient(octahedralPage, first + across(low.x + 1, low.y)),
                     coefficient(octahedralPage, first + across(low.x + 1, low.y + 1)), f.y);
    return mix(left, right, f.x);
  }
  float y[9] = float[9](0.2820948, 0.4886025 * d.y, 0.4886025 * d.z, 0.4886025 * d.x, 1.092548 * d.x * d.y,
                        1.092548 * d.y * d.z, 0.3153916 * (3.0 * d.z * d.z - 1.0), 1.092548 * d.x * d.z,
                        0.5462742 * (d.x * d.x - d.y * d.y));
  vec3 sum = vec3(0.0);
  if (kind == 2u) {
    for (int k = 0; k < 4; k++) sum += coefficient(linearPage, 4 * row + k) * y[k];
  } else {
    for (int k = 0; k < 9; k++) sum += coefficient(quadraticPage, 9 * row + k) * y[k];
  }
  return max(sum, 0.0);
}

// Mean radiance that a coat reflects in a mirror direction. Coats without baked light reflect the texel's mean light.
vec3 reflected(Blend b, vec3 mirrored, vec3 otherwise) {
  if (!hasCoats) return otherwise;
  // Use the direction of the nearest cell for the piecewise constant look-up.
  if (coatMode == 1) mirrored = fromSquare((floor(clamp((toSquare(mirrored) + 1.0) * 4.0, 0.0, 7.99)) + 0.5) / 4.0 - 1.0);
  vec3 sum = vec3(0.0);
  float weights = 0.0;
  for (int k = 0; k < 4; k++) {
    uint texel = texelFetch(placeImage, b.texels[k], 0).r;
    if (texel != 0u && b.weights[k] > 0.0) {
      sum += b.weights[k] * compact(texel, mirrored);
      weights += b.weights[k];
    }
  }
  return weights > 0.0 ? sum / weights : otherwise;
}
