// What a model multiplies its specular term by (model_shader.h).
#ifndef SPECULAR_WEIGHT
#define SPECULAR_WEIGHT 1.0
#endif
