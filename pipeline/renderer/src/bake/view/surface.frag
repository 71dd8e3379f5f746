centroid in vec3 at;
centroid in vec3 smoothNormal;
centroid in vec2 place;
centroid in vec2 coordinates0;
centroid in vec2 coordinates1;
centroid in vec2 coordinates2;
centroid in vec4 vertexColor;
out vec4 shown;

uniform vec3 eye;
uniform vec3 forward;
uniform bool parallel;

// Material.
uniform vec3 baseColor;
uniform float opacityFactor;
uniform int alphaMode;
uniform float cutoff;
uniform float metallicFactor;
uniform float roughnessFactor;
uniform vec3 dielectric;
uniform vec3 emission;
uniform bool mayHaveCoat;
uniform int baseSet;
uniform int roughSet;
uniform int emissionSet;
uniform sampler2D baseImage;
uniform sampler2D roughImage;
uniform sampler2D emissionImage;

// Light: texels of the atlas (0), mean light (1), unlit (2).
uniform int litBy;
uniform vec3 meanLight;
uniform sampler2D irradianceImage;

// Coats: compact light (0), the same piecewise constant (1), none (2).
uniform int coatMode;
uniform bool hasCoats;
uniform highp usampler2D placeImage;
uniform sampler2D constantPage;
uniform sampler2D linearPage;
uniform sampler2D quadraticPage;
uniform sampler2D octahedralPage;
uniform sampler2D albedoImage;
uniform int albedoSteps;

vec2 coordinates(int set) {
  return set == 0 ? coordinates0 : set == 1 ? coordinates1 : coordinates2;
}

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

// Albedos of a coat's single scattering, facing and grazing: the table of the crate render-core.
vec2 albedos(float roughness, float cosine) {
  float last = float(albedoSteps - 1);
  vec2 p = vec2(sqrt(clamp(cosine, 0.0, 1.0)), clamp(roughness, 0.0, 1.0)) * last;
  ivec2 i = min(ivec2(p), albedoSteps - 2);
  vec2 f = p - vec2(i);
  vec2 low = mix(texelFetch(albedoImage, i, 0).rg, texelFetch(albedoImage, i + ivec2(1, 0), 0).rg, f.x);
  vec2 high = mix(texelFetch(albedoImage, i + ivec2(0, 1), 0).rg, texelFetch(albedoImage, i + ivec2(1, 1), 0).rg, f.x);
  return mix(low, high, f.y);
}

vec2 meanAlbedos(float roughness) {
  float p = clamp(roughness, 0.0, 1.0) * float(albedoSteps - 1);
  int i = min(int(p), albedoSteps - 2);
  vec2 low = texelFetch(albedoImage, ivec2(i, albedoSteps), 0).rg;
  return mix(low, texelFetch(albedoImage, ivec2(i + 1, albedoSteps), 0).rg, p - float(i));
}

vec3 withFresnel(vec2 albedo, vec3 f0) {
  return f0 * (albedo.x - albedo.y) + albedo.y;
}

// Albedos toward the viewer of the coat and of all below it: Bsdf of the crate render-core.
void coatAlbedos(vec3 albedo, vec3 f0, float roughness, float cosine, out vec3 coat, out vec3 below) {
  vec2 mean = meanAlbedos(roughness);
  vec3 fresnelMean = f0 + (1.0 - f0) / 21.0;
  float lostMean = max(1.0 - mean.x, 1e-6);
  vec3 bouncing = fresnelMean * fresnelMean * mean.x / (1.0 - fresnelMean * lostMean);
  vec3 throughMean = max(1.0 - withFresnel(mean, f0) - bouncing * lostMean, 1e-6);
  vec2 single = albedos(roughness, cosine);
  float lost = max(1.0 - single.x, 0.0);
  coat = withFresnel(single, f0);
  vec3 through = max(1.0 - coat - bouncing * lost, 0.0);
  below = bouncing * lost + albedo * through;
}

void main() {
  // Sample all textures and derivatives first, before any pixel ends.
  vec4 base = vec4(baseColor, opacityFactor) * vertexColor;
  if (baseSet >= 0) base *= texture(baseImage, coordinates(baseSet));
  vec2 rough = vec2(roughnessFactor, metallicFactor);
  if (roughSet >= 0) rough *= texture(roughImage, coordinates(roughSet)).gb;
  vec3 light = emission;
  if (emissionSet >= 0) light *= texture(emissionImage, coordinates(emissionSet)).rgb;
  vec3 flatNormal = cross(dFdx(at), dFdy(at));
  base = clamp(base, 0.0, 1.0);
  if (alphaMode == 1 && base.a < cutoff) discard;
  float alpha = alphaMode == 2 ? base.a : 1.0;
  if (litBy == 2) {
    shown = vec4(display(base.rgb * light), alpha);
    return;
  }

  Blend texels = blend(place);
  vec3 arriving = litBy == 0 ? irradiance(texels) : meanLight;
  vec3 albedo = base.rgb * (1.0 - rough.y);
  vec3 f0 = mix(dielectric, base.rgb, rough.y);
  // A dielectric of roughness 1 has no coat: Material::split.
  bool isCoated = mayHaveCoat && (rough.y > 0.0 || rough.x < 1.0) && f0 != vec3(0.0);
  if (isCoated) {
    vec3 d = parallel ? forward : normalize(at - eye);
    vec3 n = dot(smoothNormal, smoothNormal) > 0.1 ? normalize(smoothNormal) : normalize(flatNormal);
    if (dot(smoothNormal, smoothNormal) <= 0.1 && dot(n, d) > 0.0) n = -n;
    // Bend a normal that faces away back to grazing.
    float away = dot(n, d);
    if (away >= 0.0) n = normalize(n - d * (away + 1e-3));
    vec3 coat, below;
    coatAlbedos(albedo, f0, rough.x, -dot(n, d), coat, below);
    light += below * arriving;
    if (coatMode != 2) light += coat * (litBy == 0 ? reflected(texels, reflect(d, n), arriving) : arriving);
  } else {
    light += (rough.y <= 0.0 ? base.rgb : albedo) * arriving;
  }
  shown = vec4(display(light), alpha);
}
