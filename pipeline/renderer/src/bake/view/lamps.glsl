// Lamps: points of light sources, with the visible fraction of the texels, or with shadow rays in still pictures.
uniform sampler2D lampImage;
uniform int lampPoints;
uniform bool hasVisible;
uniform sampler2D visibleImage;
uniform bool hasGroups;

// Point of a lamp at a receiver: unshadowed irradiance, direction, distance, and half the angle of its disc.
struct LampPoint {
  vec3 given, towards;
  float distance, halfAngle;
  bool isArea;
};

LampPoint lampPoint(int point, vec3 p, vec3 n, vec3 side) {
  int k = point;
#ifdef SHADOW_RAYS
  // Each sample of a pixel uses its own group of points.
  if (hasGroups) k += ((int(gl_FragCoord.x) & 1) + 2 * (int(gl_FragCoord.y) & 1)) * lampPoints;
#endif
  vec4 place = texelFetch(lampImage, ivec2(0, k), 0), axis = texelFetch(lampImage, ivec2(1, k), 0);
  vec4 light = texelFetch(lampImage, ivec2(2, k), 0);
  vec3 way = place.w == 2.0 ? place.xyz : place.xyz - p;
  float r2 = dot(way, way), r = sqrt(r2);
  vec3 d = way / r;
  float term = dot(side, d) > 0.0 ? max(dot(n, d), 0.0) : 0.0, along = -dot(d, axis.xyz);
  if (place.w == 0.0) return LampPoint(term * max(along, 0.0) / (r2 + axis.w / 8.0) * light.rgb, d, r, atan(sqrt(axis.w), r), true);
  if (place.w == 2.0) return LampPoint(term * light.rgb, d, 1e28, axis.w, false);
  float falloff = clamp((along - axis.w) * light.w, 0.0, 1.0);
  return LampPoint(term * falloff * falloff / r2 * light.rgb, d, r, 0.0, false);
}

// Visible fraction of the lamps at a point, and the weight of live texels, of which the irradiance lacks direct light.
struct Visible {
  float fraction, live;
};

Visible visibleAt(Blend b) {
  Visible v = Visible(0.0, 0.0);
  if (!hasVisible) return v;
  for (int k = 0; k < 4; k++) {
    int code = int(texelFetch(visibleImage, b.texels[k], 0).r * 255.0 + 0.5);
    v.fraction += b.weights[k] * float(code & 127) / 127.0;
    if (code > 127) v.live += b.weights[k];
  }
  return v;
}

// Irradiance from the lamps divided by π, without shadow rays.
vec3 direct(Visible v, vec3 p, vec3 n, vec3 side) {
  vec3 sum = vec3(0.0);
  for (int k = 0; k < lampPoints && v.fraction > 0.0; k++) sum += lampPoint(k, p, n, side).given;
  return sum * v.fraction / PI;
}

// Light of the lamps at a surface: irradiance divided by π, and radiance that the coat reflects.
struct LampLight {
  vec3 direct, reflected;
};

// Light of the lamps at a surface with a coat, or without one. Smooth coats reflect area lamps by rays, which find their
// surfaces. The base reflects evenly in all other terms, so its deviation is added for the mean direction of the light.
LampLight lamps(Visible v, Coat c, Passage outgoing, vec3 p, vec3 n, vec3 side, vec3 towards, bool isCoated) {
  LampLight sum = LampLight(vec3(0.0), vec3(0.0));
#ifdef SHADOW_RAYS
  bool isTraced = v.live > 0.0;
#else
  const bool isTraced = false;
#endif
  if (!isTraced && v.fraction <= 0.0) return sum;
  float cosines = 0.0;
  for (int k = 0; k < lampPoints; k++) {
    LampPoint point = lampPoint(k, p, n, side);
    if (point.given == vec3(0.0)) continue;
    float seen = v.fraction;
#ifdef SHADOW_RAYS
    if (isTraced) {
      bool isHidden = nearest(p + side * epsilon, point.towards, point.distance * 0.999, true).triangle >= 0;
      seen = mix(seen, isHidden ? 0.0 : 1.0, v.live);
      if (seen <= 0.0) continue;
    }
#endif
    vec3 given = seen * point.given;
    sum.direct += given;
    if (!isCoated) continue;
    cosines += (given.r + given.g + given.b) * dot(n, point.towards);
    if (c.roughness >= 0.2 || !point.isArea) sum.reflected += given * lobe(c, n, towards, point.towards, point.halfAngle);
  }
  float total = sum.direct.r + sum.direct.g + sum.direct.b;
  sum.direct /= PI;
  if (isCoated && total > 0.0) {
    Passage incident = passage(c, cosines / total);
    vec3 diffuse = c.bouncing / c.lostMean * outgoing.lost * incident.lost + c.albedo / c.throughMean * outgoing.through * incident.through;
    sum.reflected += sum.direct * (diffuse - diffuseAlbedo(c, outgoing));
  }
  return sum;
}
