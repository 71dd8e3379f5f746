layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec2 atlas;
layout(location = 3) in vec2 uv0;
layout(location = 4) in vec2 uv1;
layout(location = 5) in vec2 uv2;
layout(location = 6) in vec4 color;

uniform mat4 clipFromWorld;

// Centroids keep samples at edges of triangles inside the triangles.
centroid out vec3 at;
centroid out vec3 smoothNormal;
centroid out vec2 place;
centroid out vec2 coordinates0;
centroid out vec2 coordinates1;
centroid out vec2 coordinates2;
centroid out vec4 vertexColor;

void main() {
  at = position;
  smoothNormal = normal;
  place = atlas;
  coordinates0 = uv0;
  coordinates1 = uv1;
  coordinates2 = uv2;
  vertexColor = color;
  gl_Position = clipFromWorld * vec4(position, 1.0);
}
