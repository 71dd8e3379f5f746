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
uniform int baseSet;
uniform int roughSet;
uniform int emissionSet;
uniform sampler2D baseImage;
uniform sampler2D roughImage;
uniform sampler2D emissionImage;

// Opaque surfaces of the picture, behind blended surfaces.
uniform sampler2D behindImage;

// Light: texels of the atlas (0), mean light (1), unlit (2).
uniform int litBy;

vec2 coordinates(int set) {
  return set == 0 ? coordinates0 : set == 1 ? coordinates1 : coordinates2;
}

vec4 pixel(vec3 light, float alpha) {
#ifdef BLENDED
  return vec4(blended(light, alpha, texelFetch(behindImage, ivec2(gl_FragCoord.xy), 0).rgb), alpha);
#else
  return vec4(display(light), 1.0);
#endif
}

// Minimum roughness of coats with baked light.
const float BAKED_ROUGHNESS = 0.35;

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
    shown = pixel(base.rgb * light, alpha);
    return;
  }

  Blend texels = blend(place);
  vec3 arriving = litBy == 0 ? irradiance(texels) : meanLight;
  vec3 albedo = base.rgb * (1.0 - rough.y), reflectance = rough.y <= 0.0 ? base.rgb : albedo;
#if defined(COAT) || defined(LIVE)
  Visible v = Visible(0.0, 0.0);
  if (litBy == 0) v = visibleAt(texels);
  // Turn the normals toward the viewer, and bend a shading normal that faces away back to grazing.
  vec3 d = parallel ? forward : normalize(at - eye);
  vec3 side = normalize(flatNormal);
  if (dot(side, d) > 0.0) side = -side;
  vec3 n = dot(smoothNormal, smoothNormal) > 0.1 ? normalize(smoothNormal) : side;
  float away = dot(n, d);
  if (away >= 0.0) n = normalize(n - d * (away + 1e-3));
  Coat c;
  Passage outgoing;
  bool isCoated = false;
#ifdef COAT
  // A dielectric of roughness 1 has no coat: Material::split.
  vec3 f0 = mix(dielectric, base.rgb, rough.y);
  isCoated = (rough.y > 0.0 || rough.x < 1.0) && f0 != vec3(0.0);
  c = coatOf(albedo, f0, rough.x);
  outgoing = passage(c, -dot(n, d));
  if (isCoated) reflectance = diffuseAlbedo(c, outgoing);
#endif
  LampLight fromLamps = LampLight(vec3(0.0), vec3(0.0));
  if (isCoated || v.live > 0.0) fromLamps = lamps(v, c, outgoing, at, n, side, -d, isCoated);
  arriving += v.live * fromLamps.direct;
#ifdef COAT
  // Light the coat by baked light or rays, and by lamps.
  if (isCoated && coatMode != 2) {
    vec3 reflection = arriving;
    bool isTraced = false;
#ifdef REFLECTIONS
    isTraced = rough.x < BAKED_ROUGHNESS;
    if (isTraced) reflection = traced(c, outgoing, at, n, side, d);
#endif
    if (!isTraced && litBy == 0) reflection = reflected(texels, reflect(d, n), arriving);
    light += outgoing.single * reflection;
    // Smooth coats without rays reflect the mean light of their texel, which contains the light of lamps.
    if (isTraced || rough.x >= BAKED_ROUGHNESS) light += fromLamps.reflected;
  }
#endif
#endif
  light += reflectance * arriving;
  shown = pixel(light, alpha);
}
