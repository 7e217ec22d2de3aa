# The models, for btf/CMakeLists.txt; paths from btf/. A new model adds its files here and its line to
# the registry in material.cc.
set(VENEER_MODEL_SRCS
  material.cc
  model_shader.cc
  models/angular_grid.cc
  models/components.cc
  models/concentric_square.cc
  models/dichromatic_lpca/dichromatic_lpca.cc
  models/direction_lookup.cc
  models/local_pca.cc
  models/lpca/lpca.cc
  models/lpca_factors.cc
  models/material_tensors.cc
  models/matrix_product.cc
  models/packed_lpca.cc
  models/texel_colours/texel_colours.cc)
set(VENEER_MODEL_TESTS)
set(VENEER_MODEL_SHADERS
  models/dichromatic_lpca/dichromatic_lpca.glsl
  models/direction_lookup.glsl
  models/elevated_concentric.glsl
  models/lpca/lpca.glsl
  models/packed_lpca.glsl
  models/texel_colours/texel_colours.glsl)
