// Rays: the nearest triangle along a ray, or any triangle before a lamp.
// Nodes, then triangles.
uniform sampler2D rayImage;
uniform int firstTriangle;
uniform float epsilon;

vec4 record(sampler2D list, int index) {
  return texelFetch(list, ivec2(index & 1023, index >> 10), 0);
}

struct Hit {
  int triangle;
  float distance;
  vec2 weights;
};

// Distance to a box, or a huge distance for a miss.
float entry(vec3 low, vec3 high, vec3 from, vec3 inverse, float far) {
  vec3 a = (low - from) * inverse, b = (high - from) * inverse;
  vec3 near3 = min(a, b), far3 = max(a, b);
  float near = max(max(near3.x, near3.y), max(near3.z, 0.0));
  return near <= min(min(far3.x, far3.y), min(far3.z, far)) * 1.000002 ? near : 1e30;
}

// Nearest triangle up to a distance, or any triangle. Rays pass through the backs of two-sided surfaces, which have a triangle for each side.
Hit nearest(vec3 from, vec3 d, float far, bool any) {
  Hit hit = Hit(-1, far, vec2(0.0));
  vec3 inverse = 1.0 / mix(d, vec3(1e-20), lessThan(abs(d), vec3(1e-20)));
  int stack[32];
  int top = 0, reference = 0;
  while (true) {
    if (reference >= 0) {
      // Continue with the nearer child, and keep the other.
      vec4 a = record(rayImage, 4 * reference), b = record(rayImage, 4 * reference + 1);
      vec4 e = record(rayImage, 4 * reference + 2), f = record(rayImage, 4 * reference + 3);
      float left = entry(a.xyz, b.xyz, from, inverse, hit.distance), right = entry(e.xyz, f.xyz, from, inverse, hit.distance);
      bool isLeft = left <= right;
      if (min(left, right) < 1e30) {
        if (max(left, right) < 1e30) stack[top++] = int(isLeft ? b.w : a.w);
        reference = int(isLeft ? a.w : b.w);
        continue;
      }
    } else {
      // Intersect the triangles of a leaf [Möller97].
      int first = -reference >> 3, count = -reference & 7;
      for (int k = first; k < first + count; k++) {
        vec4 corner = record(rayImage, firstTriangle + 7 * k);
        vec3 u = record(rayImage, firstTriangle + 7 * k + 1).xyz, v = record(rayImage, firstTriangle + 7 * k + 2).xyz;
        vec3 p = cross(d, v), s = from - corner.xyz, q = cross(s, u);
        float determinant = dot(u, p);
        if (determinant == 0.0 || corner.w > 0.5 && determinant < 0.0) continue;
        vec3 found = vec3(dot(s, p), dot(d, q), dot(v, q)) / determinant;
        if (found.x >= 0.0 && found.y >= 0.0 && found.x + found.y <= 1.0 && found.z > 0.0 && found.z < hit.distance) {
          hit = Hit(k, found.z, found.xy);
          if (any) return hit;
        }
      }
    }
    if (top == 0) break;
    reference = stack[--top];
  }
  return hit;
}
