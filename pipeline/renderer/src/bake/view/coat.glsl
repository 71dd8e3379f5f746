// Coats: albedos and the GGX lobe of the crate render-core.
uniform sampler2D albedoImage;
uniform int albedoSteps;
const float PI = 3.14159265;

// Coat of a surface: the albedo below it, its reflectance at normal incidence, and factors of multiple scattering.
struct Coat {
  vec3 albedo, f0, bouncing, throughMean;
  float roughness, lostMean;
};

// Albedos of a coat's single scattering, facing and grazing, by the square root of the cosine.
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

Coat coatOf(vec3 albedo, vec3 f0, float roughness) {
  vec2 mean = meanAlbedos(roughness);
  vec3 fresnelMean = f0 + (1.0 - f0) / 21.0;
  float lostMean = max(1.0 - mean.x, 1e-6);
  vec3 bouncing = fresnelMean * fresnelMean * mean.x / (1.0 - fresnelMean * lostMean);
  vec3 throughMean = max(1.0 - withFresnel(mean, f0) - bouncing * lostMean, 1e-6);
  return Coat(albedo, f0, bouncing, throughMean, roughness, lostMean);
}

// Loss of single scattering, albedo of single scattering, and transmission of a coat in one direction.
struct Passage {
  float lost;
  vec3 single, through;
};

Passage passage(Coat c, float cosine) {
  vec2 albedo = albedos(c.roughness, cosine);
  float lost = max(1.0 - albedo.x, 0.0);
  vec3 single = withFresnel(albedo, c.f0);
  return Passage(lost, single, max(1.0 - single - c.bouncing * lost, 0.0));
}

// Albedo of the base and of multiple scattering in the coat.
vec3 diffuseAlbedo(Coat c, Passage outgoing) {
  return c.bouncing * outgoing.lost + c.albedo * outgoing.through;
}

// Smith's term Λ, for the squared tangent of the angle to the normal.
float masking(float alpha2, float cosine) {
  float tan2 = max(1.0 - cosine * cosine, 0.0) / (cosine * cosine);
  return (sqrt(1.0 + alpha2 * tan2) - 1.0) / 2.0;
}

vec3 fresnel(vec3 f0, float cosine) {
  return mix(f0, vec3(1.0), pow(clamp(1.0 - cosine, 0.0, 1.0), 5.0));
}

// BRDF of the single scattering F·D·G₂ / (4 cos θ_o cos θ_i) [1/sr], for light from a disc of a half angle.
vec3 lobe(Coat c, vec3 n, vec3 outgoing, vec3 incident, float halfAngle) {
  vec3 h = normalize(outgoing + incident);
  float cosO = dot(n, outgoing), cosI = dot(n, incident), cosH = dot(n, h);
  float alpha = clamp(c.roughness * c.roughness, 1e-3, 1.0);
  float alpha2 = min(alpha * alpha + halfAngle * halfAngle / 4.0, 1.0);
  vec3 across = h - cosH * n;
  float t = dot(across, across) / alpha2 + cosH * cosH;
  float shape = 1.0 / (PI * alpha2 * t * t * 4.0 * cosO * cosI * (1.0 + masking(alpha2, cosO) + masking(alpha2, cosI)));
  return fresnel(c.f0, dot(outgoing, h)) * shape;
}
