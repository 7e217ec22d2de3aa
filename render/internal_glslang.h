// SPDX-License-Identifier: Apache-2.0
#pragma once

// For the tests of render/ only.

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>

#include "base/result.h"
#include "base/testing/temporary_folder.h"

namespace veneer::render {

/// Whether the Khronos reference compiler (package glslang-tools) is there.
inline bool has_glslang() {
  return std::system("glslangValidator --version > /dev/null 2>&1") == 0;  // NOLINT(cert-env33-c)
}

/// What the reference compiler has against a complete shader; empty if nothing. It is stricter than
/// drivers are, and the same everywhere.
/// @param stage  "vert", "frag" or "comp".
inline std::string glslang_complaints(const std::string& source, const std::string& stage) {
  const TemporaryFolder folder;
  const std::string file = (folder.path() / ("shader." + stage)).string();
  std::ofstream(file) << source;
  FILE* pipe = ::popen(("glslangValidator '" + file + "' 2>&1").c_str(), "r");
  VENEER_CHECK(pipe != nullptr);
  std::string output;
  for (int c = std::fgetc(pipe); c != EOF; c = std::fgetc(pipe)) output += static_cast<char>(c);
  return ::pclose(pipe) == 0 ? std::string() : output + "\nin\n" + source;
}

}  // namespace veneer::render
