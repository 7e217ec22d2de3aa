# What nearly every file includes, parsed once for all: a build from nothing takes about half as
# long. Off by default, since it hides includes that are missing, and keeps the compiler cache from
# helping; the gate, which begins with nothing, switches it on.
option(VENEER_PRECOMPILE "Parse common headers once: for builds from nothing" OFF)

set(veneer_common_headers
  <Eigen/Core> <Eigen/Geometry> <algorithm> <array> <atomic> <chrono> <cmath> <cstdint> <filesystem>
  <fmt/format.h> <fstream> <functional> <map> <memory> <mutex> <numbers> <optional> <random> <span>
  <sstream> <string> <string_view> <thread> <tl/expected.hpp> <utility> <variant> <vector>)

# veneer_add_precompiled(TARGET HEADERS DEPS...): the target that others of the same options share.
function(veneer_add_precompiled target headers)
  set(empty ${CMAKE_BINARY_DIR}/generated/${target}.cc)
  file(WRITE ${empty}.new "// Nothing but the precompiled headers.\n")
  file(COPY_FILE ${empty}.new ${empty} ONLY_IF_DIFFERENT)
  add_library(${target} OBJECT ${empty})
  target_link_libraries(${target} PRIVATE veneer_options ${ARGN})
  target_precompile_headers(${target} PRIVATE ${headers})
endfunction()

if(VENEER_PRECOMPILE)
  # Some libraries ask for it, and all who share must agree.
  target_compile_options(veneer_options INTERFACE -pthread)
  # g++ 12 forgets there which headers are the system's, and warns of what it inlines from them.
  # Warnings are errors wherever else.
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    set(CMAKE_COMPILE_WARNING_AS_ERROR OFF)
  endif()
  veneer_add_precompiled(veneer_precompiled "${veneer_common_headers}" Eigen3::Eigen fmt::fmt)
  if(VENEER_TESTS)
    veneer_add_precompiled(veneer_precompiled_tests
      "${veneer_common_headers};<gmock/gmock.h>;<gtest/gtest.h>" Eigen3::Eigen fmt::fmt GTest::gmock)
  endif()
endif()

# veneer_use_precompiled(TARGET OF): TARGET's files begin with what OF has parsed, if it has.
function(veneer_use_precompiled target of)
  if(TARGET ${of})
    target_precompile_headers(${target} REUSE_FROM ${of})
  endif()
endfunction()
