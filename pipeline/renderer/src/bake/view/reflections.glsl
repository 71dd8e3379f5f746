// Reflection rays of coats, and the baked light of the surfaces that they hit.
uniform sampler2D materialImage;
uniform bool hasSky;

const int MOST_COATS = 3;

// Radiance along a ray from a coat. The ray follows mirror directions of further coats. `isRough` omits lamps, and `share` is
// the fraction of the pixel's light. Surfaces at the hits have mean colors.
vec3 along(vec3 from, vec3 d, bool isRough, float share) {
  vec3 sum = vec3(0.0), throughput = vec3(1.0);
  bool isBlurred = isRough;
  for (int coats = 0; coats <= MOST_COATS; coats++) {
    Hit hit = nearest(from, d, 1e29, false);
    if (hit.triangle < 0) return sum + throughput * (hasSky ? skyLight(d) : vec3(0.0));
    int first = firstTriangle + 7 * hit.triangle;
    vec4 corner = record(rayImage, first), u = record(rayImage, first + 1), v = record(rayImage, first + 2);
    vec4 places = record(rayImage, first + 3), last = record(rayImage, first + 4);
    vec3 side = normalize(cross(u.xyz, v.xyz));
    if (dot(side, d) > 0.0) return sum;

    // Material at the hit: base color and metalness, reflectance and roughness, emission and kind.
    int material = 3 * int(last.z);
    vec4 base = record(materialImage, material), coat = record(materialImage, material + 1);
    vec4 emission = record(materialImage, material + 2);
    if (last.w == 2.0) return sum;
    if (!(isRough && emission.w > 0.5)) sum += throughput * emission.rgb;
    vec2 place = places.xy * (1.0 - hit.weights.x - hit.weights.y) + places.zw * hit.weights.x + last.xy * hit.weights.y;
    vec3 albedo = base.rgb * (1.0 - base.a), f0 = mix(coat.rgb, base.rgb, base.a);
    bool isCoated = f0 != vec3(0.0) && (base.a > 0.0 || coat.a < 1.0);
    // Interpolate the normal, and bend a normal that faces away back to grazing.
    vec4 l = record(rayImage, first + 5), m = record(rayImage, first + 6);
    vec3 n = l.xyz * (1.0 - hit.weights.x - hit.weights.y) + vec3(l.w, m.xy) * hit.weights.x + vec3(m.zw, u.w) * hit.weights.y;
    n = dot(n, n) > 0.1 ? normalize(n) : side;
    float away = dot(n, d);
    if (away >= 0.0) n = normalize(n - d * (away + 1e-3));
    vec3 p = from + d * hit.distance, arriving = meanLight;
    if (last.w == 0.0) {
      Blend texels = blend(place);
      Visible v = visibleAt(texels);
      arriving = irradiance(texels);
      if (v.live > 0.0) arriving += v.live * direct(v, p, n, side);
    }
    if (!isCoated) return sum + throughput * albedo * arriving;
    Coat c = coatOf(albedo, f0, coat.a);
    Passage outgoing = passage(c, -dot(n, d));
    vec3 diffuse = diffuseAlbedo(c, outgoing);

    // Follow a coat while its reflection is a large enough fraction of the pixel's light, as in films.
    const vec3 LUMINANCE = vec3(0.2126, 0.7152, 0.0722);
    float bright = dot(outgoing.single, LUMINANCE);
    bool isMetal = bright > dot(diffuse, LUMINANCE), isDull = coat.a >= 0.2;
    float least = isBlurred ? (isDull ? 0.3 : 0.1) : 0.02;
    bool isSmall = share * dot(throughput, LUMINANCE) * bright < least || (isBlurred || isDull) && !isMetal;
    vec3 next = reflect(d, n);
    if (coats == MOST_COATS || isSmall) return sum + throughput * (diffuse + outgoing.single) * arriving;
    sum += throughput * diffuse * arriving;
    throughput *= outgoing.single;
    if (dot(next, side) <= 0.0) return sum;
    from = p + side * epsilon;
    d = next;
    isRough = isDull;
  }
  return sum;
}

// Microfacet normal that is visible from a direction, in the shading frame, for a point of the unit square [Dupuy23].
vec3 facet(float alpha, vec3 outgoing, vec2 point) {
  vec3 v = normalize(outgoing * vec3(alpha, alpha, 1.0));
  float z = (1.0 - point.y) * (1.0 + v.z) - v.z, radius = sqrt(max(1.0 - z * z, 0.0)), angle = 2.0 * PI * point.x;
  return normalize((vec3(radius * cos(angle), radius * sin(angle), z) + v) * vec3(alpha, alpha, 1.0));
}

// Mean radiance that a coat reflects toward the viewer: a mirror ray, or several rays for a wider lobe.
vec3 traced(Coat c, Passage outgoing, vec3 p, vec3 n, vec3 side, vec3 d) {
  float alpha = c.roughness * c.roughness, share = dot(outgoing.single, vec3(0.2126, 0.7152, 0.0722));
  vec3 from = p + side * epsilon;
  int count = alpha < 0.006 ? 1 : 8;
  if (count == 1) {
    vec3 mirrored = reflect(d, n);
    return dot(mirrored, side) > 0.0 ? along(from, mirrored, false, share) : vec3(0.0);
  }
  vec3 x = normalize(abs(n.x) > 0.5 ? cross(n, vec3(0.0, 1.0, 0.0)) : cross(n, vec3(1.0, 0.0, 0.0))), y = cross(n, x);
  vec3 local = -vec3(dot(d, x), dot(d, y), dot(d, n));
  float noise = fract(52.9829189 * fract(dot(floor(gl_FragCoord.xy), vec2(0.06711056, 0.00583715))));
  vec3 sum = vec3(0.0), weights = vec3(0.0);
  for (int k = 0; k < count; k++) {
    // Rotate a rank-one lattice by noise of the pixel.
    vec2 point = fract(vec2(0.7548777, 0.5698403) * (float(k) + 0.5) + noise);
    vec3 h = facet(alpha, local, point), incident = reflect(-local, h);
    if (incident.z <= 0.0) continue;
    float own = 1.0 + masking(alpha * alpha, local.z);
    vec3 weight = fresnel(c.f0, dot(local, h)) * own / (own + masking(alpha * alpha, incident.z));
    vec3 way = x * incident.x + y * incident.y + n * incident.z;
    weights += weight;
    if (dot(way, side) > 0.0) sum += weight * along(from, way, c.roughness >= 0.2, share);
  }
  return sum / max(weights, vec3(1e-20));
}
