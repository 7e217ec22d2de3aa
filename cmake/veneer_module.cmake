# One rule for every module, so that a module is a dozen lines and its floor cannot be forgotten.

# Options that all of our own targets share.
add_library(veneer_options INTERFACE)
target_include_directories(veneer_options INTERFACE ${CMAKE_SOURCE_DIR} ${CMAKE_BINARY_DIR}/generated)
target_compile_options(veneer_options INTERFACE -Wall -Wextra -Wshadow -Wnon-virtual-dtor
                                                -Wmissing-declarations)
# g++ 12 warns of overlapping copies in std::string's own operator+ (GCC bug 105651).
target_compile_options(veneer_options INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>)
# x86-64-v2 plus F16C, FMA and AVX2: every machine that can drive a projector with GL 4.5 has them.
if(CMAKE_SYSTEM_PROCESSOR STREQUAL "x86_64")
  target_compile_options(veneer_options INTERFACE -march=x86-64-v3)
endif()

include(${CMAKE_CURRENT_LIST_DIR}/precompiled.cmake)

# Every test program, so that a sanitizer build can ask for these alone.
add_custom_target(veneer_tests)

# veneer_add_test(NAME SRCS ... [DEPS ...] [HALVES])
#
# Makes the GoogleTest program veneer_NAME_test and the ctest NAME, or two of half its cases each,
# NAME_1 and NAME_2, for what takes long; their results go to test-results/, where ./dev test counts
# the cases. A test that draws is labelled gl.
function(veneer_add_test name)
  cmake_parse_arguments(T "HALVES" "" "SRCS;DEPS" ${ARGN})
  add_executable(veneer_${name}_test ${T_SRCS})
  target_link_libraries(veneer_${name}_test PRIVATE ${T_DEPS} GTest::gtest GTest::gmock
                                                    GTest::gtest_main)
  veneer_use_precompiled(veneer_${name}_test veneer_precompiled_tests)
  add_dependencies(veneer_tests veneer_${name}_test)
  # Real measured data; tests that need it skip, saying so, where it is absent.
  set(data ${CMAKE_SOURCE_DIR}/../shared/data)
  if(DEFINED ENV{VENEER_DATA})
    set(data $ENV{VENEER_DATA})
  endif()
  veneer_uses_gl(gl ${T_DEPS})
  set(runs ${name})
  if(T_HALVES)
    set(runs ${name}_1 ${name}_2)
  endif()
  set(index 0)
  foreach(run IN LISTS runs)
    add_test(NAME ${run} COMMAND veneer_${name}_test)
    set_property(TEST ${run} PROPERTY ENVIRONMENT
      "VENEER_DATA=${data}" "GTEST_OUTPUT=xml:${CMAKE_BINARY_DIR}/test-results/${run}.xml")
    if(T_HALVES)
      set_property(TEST ${run} APPEND PROPERTY ENVIRONMENT
        GTEST_TOTAL_SHARDS=2 GTEST_SHARD_INDEX=${index})
      math(EXPR index "${index} + 1")
    endif()
    if(gl)
      set_property(TEST ${run} PROPERTY LABELS gl)
    endif()
  endforeach()
endfunction()

# veneer_add_bus_test(NAME SRCS ... [DEPS ...])
#
# As veneer_add_test, for a program whose USB and HID devices are mocked (tracking/testing/).
# umockdev's library must be the first to be loaded and GLib keeps what it once allocated, so that
# the address sanitizer is told to mind neither.
function(veneer_add_bus_test name)
  cmake_parse_arguments(B "" "" "SRCS;DEPS" ${ARGN})
  add_executable(veneer_${name}_test ${B_SRCS})
  target_link_libraries(veneer_${name}_test PRIVATE ${B_DEPS} veneer_mock_bus)
  veneer_use_precompiled(veneer_${name}_test veneer_precompiled_tests)
  add_dependencies(veneer_tests veneer_${name}_test)
  add_test(NAME ${name} COMMAND ${UMOCKDEV_WRAPPER} $<TARGET_FILE:veneer_${name}_test>)
  set_tests_properties(${name} PROPERTIES
    SKIP_RETURN_CODE 77 RUN_SERIAL TRUE
    ENVIRONMENT "GTEST_OUTPUT=xml:${CMAKE_BINARY_DIR}/test-results/${name}.xml;ASAN_OPTIONS=verify_asan_link_order=0:detect_leaks=0")
endfunction()

# veneer_uses_gl(RESULT DEPS...): whether one of DEPS is GL itself or a module that uses it.
function(veneer_uses_gl result)
  set(${result} FALSE PARENT_SCOPE)
  foreach(dep IN LISTS ARGN)
    set(dep_uses_gl FALSE)
    if(TARGET ${dep})
      get_target_property(dep_uses_gl ${dep} VENEER_GL)
    endif()
    if(dep_uses_gl OR dep STREQUAL "PkgConfig::EPOXY")
      set(${result} TRUE PARENT_SCOPE)
    endif()
  endforeach()
endfunction()

# veneer_add_module(NAME LAYER n SRCS ... [TESTS ...] [DEPS ...] [PRIVATE_DEPS ...] [TEST_DEPS ...])
#
# Makes the library veneer::NAME of floor n from SRCS and the test program veneer_NAME_test from
# TESTS. DEPS and PRIVATE_DEPS name veneer:: modules of lower floors and third-party targets; a
# module of the same or a higher floor stops the configuration. Headers that reach across floors
# without linking are caught by tools/check_includes.py, which reads LAYER from here too.
function(veneer_add_module name)
  cmake_parse_arguments(M "" "LAYER" "SRCS;TESTS;DEPS;PRIVATE_DEPS;TEST_DEPS" ${ARGN})
  if(M_UNPARSED_ARGUMENTS OR NOT M_LAYER)
    message(FATAL_ERROR "veneer_add_module(${name}): LAYER is required; unknown: ${M_UNPARSED_ARGUMENTS}")
  endif()
  add_library(veneer_${name} STATIC ${M_SRCS})
  add_library(veneer::${name} ALIAS veneer_${name})
  target_link_libraries(veneer_${name} PUBLIC veneer_options ${M_DEPS} PRIVATE ${M_PRIVATE_DEPS})
  veneer_use_precompiled(veneer_${name} veneer_precompiled)
  foreach(dep IN LISTS M_DEPS M_PRIVATE_DEPS)
    # The floors are added lowest first, so what is not there yet is above (or misspelt).
    if(dep MATCHES "^veneer::" AND NOT TARGET ${dep})
      message(FATAL_ERROR "veneer_${name} (floor ${M_LAYER}) may not use ${dep}: no lower floor has it")
    endif()
    if(TARGET ${dep})
      get_target_property(dep_layer ${dep} VENEER_LAYER)
      if(dep_layer AND NOT dep_layer LESS M_LAYER)
        message(FATAL_ERROR "veneer_${name} (floor ${M_LAYER}) may not use ${dep} (floor ${dep_layer})")
      endif()
    endif()
  endforeach()
  veneer_uses_gl(gl ${M_DEPS} ${M_PRIVATE_DEPS})
  set_target_properties(veneer_${name} PROPERTIES VENEER_LAYER ${M_LAYER} VENEER_GL ${gl})
  if(VENEER_TESTS AND M_TESTS)
    veneer_add_test(${name} SRCS ${M_TESTS} DEPS veneer::${name} ${M_TEST_DEPS})
  endif()
endfunction()

# veneer_add_fuzzer(NAME SRCS ... [DEPS ...])
#
# Makes the libFuzzer program veneer_NAME_fuzzer, in a build that is instrumented for it (the preset
# fuzz); ./dev fuzz runs each for a bounded time. SRCS define fuzzed_reader() (base/testing/fuzzing.h).
add_custom_target(veneer_fuzzers)
function(veneer_add_fuzzer name)
  if(NOT VENEER_FUZZERS)
    return()
  endif()
  cmake_parse_arguments(F "" "" "SRCS;DEPS" ${ARGN})
  add_executable(veneer_${name}_fuzzer ${F_SRCS} $<TARGET_OBJECTS:veneer_fuzzing>)
  target_link_libraries(veneer_${name}_fuzzer PRIVATE ${F_DEPS})
  target_link_options(veneer_${name}_fuzzer PRIVATE -fsanitize=fuzzer)
  add_dependencies(veneer_fuzzers veneer_${name}_fuzzer)
endfunction()

# veneer_embed(TARGET FILE...)
#
# Embeds text files (shaders) into TARGET: shaders/x.frag becomes the header "<folder>/shaders/x.frag.inc",
# a raw string literal to be included where a const char array is initialised.
function(veneer_embed target)
  foreach(file IN LISTS ARGN)
    cmake_path(ABSOLUTE_PATH file BASE_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR} OUTPUT_VARIABLE in)
    cmake_path(RELATIVE_PATH in BASE_DIRECTORY ${CMAKE_SOURCE_DIR} OUTPUT_VARIABLE relative)
    set(out ${CMAKE_BINARY_DIR}/generated/${relative}.inc)
    add_custom_command(
      OUTPUT ${out}
      COMMAND ${CMAKE_COMMAND} -DIN=${in} -DOUT=${out} -P ${CMAKE_SOURCE_DIR}/cmake/embed.cmake
      DEPENDS ${in} ${CMAKE_SOURCE_DIR}/cmake/embed.cmake
      VERBATIM)
    target_sources(${target} PRIVATE ${out})
  endforeach()
endfunction()
