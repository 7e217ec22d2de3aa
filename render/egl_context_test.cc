// SPDX-License-Identifier: Apache-2.0
#include "render/egl_context.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <optional>

#include "render/gl_objects.h"

namespace veneer::render {
namespace {

TEST(EglContext, GivesOpenGl45AndSaysWhich) {
  const auto context = EglContext::create();
  if (!context) GTEST_SKIP() << context.error().what;
  GLint major = 0;
  GLint minor = 0;
  glGetIntegerv(GL_MAJOR_VERSION, &major);
  glGetIntegerv(GL_MINOR_VERSION, &minor);
  EXPECT_GE(10 * major + minor, 45);
  EXPECT_NE(context->description().find("through"), std::string::npos);
}

TEST(EglContext, OneThatGoesLeavesTheOthersAlive) {
  auto kept = EglContext::create();
  if (!kept) GTEST_SKIP() << kept.error().what;
  {
    const auto other = EglContext::create();
    ASSERT_TRUE(other) << other.error().what;
    EXPECT_NE(eglGetCurrentContext(), EGL_NO_CONTEXT);
  }
  kept->make_current();
  const GlBuffer buffer = make_buffer();
  EXPECT_NE(buffer.id(), 0U);
  EXPECT_EQ(glGetError(), static_cast<GLenum>(GL_NO_ERROR));
}

TEST(EglContext, SaysWhatWasTriedAndWhatToInstall) {
  ASSERT_EQ(::setenv("VENEER_EGL", "no such platform", 1), 0);
  const auto context = EglContext::create();
  ::unsetenv("VENEER_EGL");
  ASSERT_FALSE(context);
  EXPECT_EQ(context.error().code, Errc::kUnavailable);
  EXPECT_NE(context.error().what.find("no such platform"), std::string::npos)
      << context.error().what;
  EXPECT_NE(context.error().what.find("apt-get install"), std::string::npos)
      << context.error().what;
}

TEST(LinkProgram, GivesTheDriversLog) {
  const auto context = EglContext::create();
  if (!context) GTEST_SKIP() << context.error().what;
  const auto program =
      link_program({{GL_COMPUTE_SHADER, "broken.comp", "#version 450 core\nnonsense"}});
  ASSERT_FALSE(program);
  EXPECT_EQ(program.error().code, Errc::kUnavailable);
  EXPECT_NE(program.error().what.find("broken.comp"), std::string::npos);
  EXPECT_GT(program.error().what.size(), 60U) << program.error().what;
}

}  // namespace
}  // namespace veneer::render
