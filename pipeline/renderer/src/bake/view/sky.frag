out vec4 shown;

uniform vec3 right;
uniform vec3 up;
uniform vec3 ahead;
uniform vec2 pictureSize;

void main() {
  vec2 p = gl_FragCoord.xy / pictureSize * 2.0 - 1.0;
  vec3 d = normalize(ahead + right * p.x + up * p.y);
  shown = vec4(display(skyLight(d)), 1.0);
}
