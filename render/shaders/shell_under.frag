// Puts what one turn of the shells has drawn under what was drawn before; blending does the rest.
layout(location = 0) out vec4 seen;
uniform sampler2D Nearest;

void main() { seen = texelFetch(Nearest, ivec2(gl_FragCoord.xy), 0); }
