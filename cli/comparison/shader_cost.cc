// SPDX-License-Identifier: Apache-2.0
#include "cli/comparison/shader_cost.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <regex>
#include <system_error>
#include <utility>
#include <vector>

#include "base/files.h"

namespace veneer::cli {
namespace {

namespace fs = std::filesystem;

// Instructions that compute, sorted. Every other moves, fetches, declares or branches.
constexpr std::array<std::string_view, 70> kArithmetic{
    "OpAll",
    "OpAny",
    "OpBitCount",
    "OpBitFieldInsert",
    "OpBitFieldSExtract",
    "OpBitFieldUExtract",
    "OpBitReverse",
    "OpBitwiseAnd",
    "OpBitwiseOr",
    "OpBitwiseXor",
    "OpConvertFToS",
    "OpConvertFToU",
    "OpConvertSToF",
    "OpConvertUToF",
    "OpDPdx",
    "OpDPdy",
    "OpDot",
    "OpExtInst",
    "OpFAdd",
    "OpFDiv",
    "OpFMod",
    "OpFMul",
    "OpFNegate",
    "OpFOrdEqual",
    "OpFOrdGreaterThan",
    "OpFOrdGreaterThanEqual",
    "OpFOrdLessThan",
    "OpFOrdLessThanEqual",
    "OpFOrdNotEqual",
    "OpFRem",
    "OpFSub",
    "OpFUnordEqual",
    "OpFUnordNotEqual",
    "OpFwidth",
    "OpIAdd",
    "OpIEqual",
    "OpIMul",
    "OpINotEqual",
    "OpISub",
    "OpIsInf",
    "OpIsNan",
    "OpLogicalAnd",
    "OpLogicalEqual",
    "OpLogicalNot",
    "OpLogicalNotEqual",
    "OpLogicalOr",
    "OpMatrixTimesMatrix",
    "OpMatrixTimesScalar",
    "OpMatrixTimesVector",
    "OpNot",
    "OpOuterProduct",
    "OpSDiv",
    "OpSGreaterThan",
    "OpSGreaterThanEqual",
    "OpSLessThan",
    "OpSLessThanEqual",
    "OpSMod",
    "OpSNegate",
    "OpSRem",
    "OpSelect",
    "OpShiftLeftLogical",
    "OpShiftRightArithmetic",
    "OpShiftRightLogical",
    "OpTranspose",
    "OpUDiv",
    "OpUGreaterThan",
    "OpULessThan",
    "OpUMod",
    "OpVectorTimesMatrix",
    "OpVectorTimesScalar",
};
static_assert(std::ranges::is_sorted(kArithmetic));

constexpr std::string_view kHeader =
    "#version 450 core\n#extension GL_EXT_control_flow_attributes : require\n";
constexpr std::string_view kMain = R"(
layout(location = 0) in vec2 uv_of_pixel;
layout(location = 1) in vec3 view_of_pixel;
layout(location = 2) in vec3 light_of_pixel;
layout(location = 0) out vec4 colour_of_pixel;
void main() {
  colour_of_pixel = vec4(btf_radiance(uv_of_pixel, view_of_pixel, light_of_pixel), 1.0);
}
)";

class ScratchFolder {
 public:
  static Result<ScratchFolder> create() {
    std::error_code error;
    std::string name = (fs::temp_directory_path(error) / "veneer-shader-XXXXXX").string();
    if (error || ::mkdtemp(name.data()) == nullptr)
      return fail(Errc::kIo, "making a folder for temporary files: {}; set TMPDIR", name);
    return ScratchFolder(name);
  }
  ScratchFolder(ScratchFolder&& other) noexcept : path_(std::exchange(other.path_, {})) {}
  ScratchFolder& operator=(ScratchFolder&&) = delete;
  ~ScratchFolder() {
    std::error_code ignored;
    if (!path_.empty()) fs::remove_all(path_, ignored);
  }
  [[nodiscard]] const fs::path& path() const { return path_; }

 private:
  explicit ScratchFolder(fs::path path) : path_(std::move(path)) {}
  fs::path path_;
};

// Runs a program of the PATH and waits for it; what it says goes to the file `log`.
Status run(std::vector<std::string> command, const fs::path& log) {
  std::vector<char*> argv;
  argv.reserve(command.size() + 1);
  for (std::string& argument : command) argv.push_back(argument.data());
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_addopen(
      &actions, STDOUT_FILENO, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  ::posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
  pid_t pid = 0;
  const int error = ::posix_spawnp(&pid, argv[0], &actions, nullptr, argv.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  if (error == ENOENT)
    return fail(Errc::kUnavailable,
                "counting a shader's instructions: {} is not there; install glslang-tools and "
                "spirv-tools",
                command.front());
  if (error != 0) return fail(Errc::kIo, "starting {}: {}", command.front(), std::strerror(error));
  int status = 0;
  while (::waitpid(pid, &status, 0) < 0)
    if (errno != EINTR)
      return fail(Errc::kIo, "waiting for {}: {}", command.front(), std::strerror(errno));
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0)
    return fail(Errc::kBadFormat,
                "compiling a model's shader: {} refuses it: {}",
                command.front(),
                read_text(log).value_or("it says nothing"));
  return {};
}

}  // namespace

ShaderCost count_instructions(std::string_view disassembly) {
  ShaderCost cost;
  while (!disassembly.empty()) {
    const std::size_t end = std::min(disassembly.find('\n'), disassembly.size());
    std::string_view line = disassembly.substr(0, end);
    disassembly.remove_prefix(std::min(end + 1, disassembly.size()));
    line.remove_prefix(std::min(line.find_first_not_of(' '), line.size()));
    if (line.starts_with('%'))  // "%result = OpCode ..."
      line.remove_prefix(std::min(line.find("Op"), line.size()));
    const std::string_view code = line.substr(0, line.find(' '));
    if (std::ranges::binary_search(kArithmetic, code)) ++cost.arithmetic;
    // Not the question for a texture's size, nor OpImage, which takes a sampler off.
    if (code.starts_with("OpImageSample") || code == "OpImageFetch" || code == "OpImageGather")
      ++cost.fetches;
    if (code == "OpLoopMerge") cost.loops_left = true;
  }
  return cost;
}

Result<ShaderCost> shader_cost(const std::string& model_source) {
  VENEER_ASSIGN(const ScratchFolder folder, ScratchFolder::create());
  const auto at = [&folder](const char* name) { return (folder.path() / name).string(); };
  // The optimiser writes out only loops that ask for it.
  const std::string body =
      std::regex_replace(model_source, std::regex(R"(\bfor \()"), "[[unroll]] for (");
  VENEER_TRY(write_text(at("model.frag"), std::string(kHeader) + body + std::string(kMain)));
  const std::string log = at("log");
  VENEER_TRY(run({"glslangValidator",
                  "-G",
                  "--auto-map-bindings",
                  "--auto-map-locations",
                  "-o",
                  at("model.spv"),
                  at("model.frag")},
                 log));
  // Inlined by the first -O; what writing loops out leaves to fold is folded by the second.
  VENEER_TRY(run(
      {"spirv-opt", "-O", "--loop-unroll", "-O", at("model.spv"), "-o", at("optimised.spv")}, log));
  VENEER_TRY(run({"spirv-dis", "--no-color", at("optimised.spv"), "-o", at("optimised.txt")}, log));
  VENEER_ASSIGN(const std::string disassembly, read_text(at("optimised.txt")));
  return count_instructions(disassembly);
}

}  // namespace veneer::cli
