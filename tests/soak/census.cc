// SPDX-License-Identifier: Apache-2.0
#include "tests/soak/census.h"

#include <epoxy/egl.h>
#include <epoxy/gl.h>
#include <fmt/format.h>
#include <malloc.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "base/result.h"

namespace veneer::soak {
namespace {

std::atomic<std::int64_t> live{0};

/// The driver's own function; epoxy's pointers are replaced by ours, and would call us.
template <class Function>
Function* of_driver(const char* name) {
  auto* const found = reinterpret_cast<Function*>(eglGetProcAddress(name));
  VENEER_CHECK(found != nullptr);
  return found;
}

std::int64_t not_zero(GLsizei n, const GLuint* names) {
  std::int64_t count = 0;
  for (GLsizei i = 0; i < n; ++i) count += names[i] != 0 ? 1 : 0;
  return count;
}

// One pair of functions for each kind of object that is made by the dozen.
#define VENEER_COUNT_MADE(Name)                                        \
  void make_##Name(GLsizei n, GLuint* names) {                         \
    static auto* const call = of_driver<decltype(make_##Name)>(#Name); \
    call(n, names);                                                    \
    live += n;                                                         \
  }
#define VENEER_COUNT_MADE_OF_KIND(Name)                                \
  void make_##Name(GLenum kind, GLsizei n, GLuint* names) {            \
    static auto* const call = of_driver<decltype(make_##Name)>(#Name); \
    call(kind, n, names);                                              \
    live += n;                                                         \
  }
#define VENEER_COUNT_DELETED(Name)                                       \
  void delete_##Name(GLsizei n, const GLuint* names) {                   \
    static auto* const call = of_driver<decltype(delete_##Name)>(#Name); \
    call(n, names);                                                      \
    live -= not_zero(n, names);                                          \
  }
VENEER_COUNT_MADE(glCreateBuffers)
VENEER_COUNT_MADE(glCreateFramebuffers)
VENEER_COUNT_MADE(glCreateVertexArrays)
VENEER_COUNT_MADE(glGenTextures)
VENEER_COUNT_MADE(glGenBuffers)
VENEER_COUNT_MADE(glGenFramebuffers)
VENEER_COUNT_MADE(glGenVertexArrays)
VENEER_COUNT_MADE(glGenQueries)
VENEER_COUNT_MADE_OF_KIND(glCreateTextures)
VENEER_COUNT_MADE_OF_KIND(glCreateQueries)
VENEER_COUNT_DELETED(glDeleteTextures)
VENEER_COUNT_DELETED(glDeleteBuffers)
VENEER_COUNT_DELETED(glDeleteFramebuffers)
VENEER_COUNT_DELETED(glDeleteVertexArrays)
VENEER_COUNT_DELETED(glDeleteQueries)
#undef VENEER_COUNT_MADE
#undef VENEER_COUNT_MADE_OF_KIND
#undef VENEER_COUNT_DELETED

GLuint make_program() {
  static auto* const call = of_driver<GLuint()>("glCreateProgram");
  ++live;
  return call();
}
GLuint make_shader(GLenum stage) {
  static auto* const call = of_driver<GLuint(GLenum)>("glCreateShader");
  ++live;
  return call(stage);
}
void delete_program(GLuint name) {
  static auto* const call = of_driver<void(GLuint)>("glDeleteProgram");
  call(name);
  if (name != 0) --live;
}
void delete_shader(GLuint name) {
  static auto* const call = of_driver<void(GLuint)>("glDeleteShader");
  call(name);
  if (name != 0) --live;
}

std::int64_t entries_of(const char* folder) {
  return std::distance(std::filesystem::directory_iterator(folder), {});
}

}  // namespace

void count_gl_objects() {
  epoxy_glCreateBuffers = make_glCreateBuffers;
  epoxy_glCreateFramebuffers = make_glCreateFramebuffers;
  epoxy_glCreateVertexArrays = make_glCreateVertexArrays;
  epoxy_glCreateTextures = make_glCreateTextures;
  epoxy_glCreateQueries = make_glCreateQueries;
  epoxy_glGenTextures = make_glGenTextures;
  epoxy_glGenBuffers = make_glGenBuffers;
  epoxy_glGenFramebuffers = make_glGenFramebuffers;
  epoxy_glGenVertexArrays = make_glGenVertexArrays;
  epoxy_glGenQueries = make_glGenQueries;
  epoxy_glDeleteTextures = delete_glDeleteTextures;
  epoxy_glDeleteBuffers = delete_glDeleteBuffers;
  epoxy_glDeleteFramebuffers = delete_glDeleteFramebuffers;
  epoxy_glDeleteVertexArrays = delete_glDeleteVertexArrays;
  epoxy_glDeleteQueries = delete_glDeleteQueries;
  epoxy_glCreateProgram = make_program;
  epoxy_glCreateShader = make_shader;
  epoxy_glDeleteProgram = delete_program;
  epoxy_glDeleteShader = delete_shader;
}

std::int64_t live_gl_objects() { return live; }

Holdings Holdings::now() {
  Holdings holdings;
  const struct mallinfo2 heap = ::mallinfo2();
  holdings.heap_bytes = static_cast<std::int64_t>(heap.uordblks + heap.hblkhd);
  std::int64_t total_pages = 0;
  std::int64_t resident_pages = 0;
  std::ifstream("/proc/self/statm") >> total_pages >> resident_pages;
  holdings.resident_bytes = resident_pages * ::sysconf(_SC_PAGESIZE);
  holdings.descriptors = entries_of("/proc/self/fd");
  holdings.threads = entries_of("/proc/self/task");
  holdings.gl_objects = live_gl_objects();
  return holdings;
}

std::string text_of(const Holdings& holdings) {
  return fmt::format(
      "heap {:.2f} MB, resident {:.2f} MB, {} descriptors, {} threads, {} GL objects",
      1e-6 * static_cast<double>(holdings.heap_bytes),
      1e-6 * static_cast<double>(holdings.resident_bytes),
      holdings.descriptors,
      holdings.threads,
      holdings.gl_objects);
}

}  // namespace veneer::soak
