# The models' sources, tests and shaders, relative to btf/; the author of a model adds its lines here.
set(VENEER_MODEL_SRCS)
set(VENEER_MODEL_TESTS)
set(VENEER_MODEL_SHADERS)
