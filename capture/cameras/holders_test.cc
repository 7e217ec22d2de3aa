// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>

#include "base/files.h"
#include "base/testing/temporary_folder.h"
#include "capture/cameras/internal_holders.h"

namespace veneer::capture {
namespace {

/// Another process, which opens a file and holds it until the test is over.
class Opener {
 public:
  explicit Opener(const std::filesystem::path& path) {
    std::array<int, 2> ready{};
    if (::pipe(ready.data()) != 0) return;
    process_ = ::fork();
    if (process_ == 0) {
      ::prctl(PR_SET_PDEATHSIG, SIGKILL);  // never outlives a test that crashed
      std::FILE* file = std::fopen(path.c_str(), "r");
      const char byte = file != nullptr ? 'y' : 'n';
      if (::write(ready[1], &byte, 1) != 1) ::_exit(1);
      for (;;) ::pause();
    }
    char byte = 0;
    opened_ = ::read(ready[0], &byte, 1) == 1 && byte == 'y';
    ::close(ready[0]);
    ::close(ready[1]);
  }
  ~Opener() {
    if (process_ <= 0) return;
    ::kill(process_, SIGKILL);
    ::waitpid(process_, nullptr, 0);
  }
  Opener(const Opener&) = delete;
  Opener& operator=(const Opener&) = delete;
  [[nodiscard]] bool opened() const { return opened_; }
  [[nodiscard]] pid_t process() const { return process_; }

 private:
  pid_t process_ = -1;
  bool opened_ = false;
};

TEST(HoldersOf, NamesTheOtherProgramAndNotThisOne) {
  const TemporaryFolder folder;
  const auto path = folder.path() / "device";
  ASSERT_TRUE(write_text(path, "x"));
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> own(std::fopen(path.c_str(), "r"),
                                                            &std::fclose);
  EXPECT_TRUE(holders_of(path).empty());
  {
    const Opener other(path);
    ASSERT_TRUE(other.opened());
    const auto holders = holders_of(path);
    ASSERT_EQ(holders.size(), 1u);
    EXPECT_EQ(holders[0].process, other.process());
    EXPECT_FALSE(holders[0].name.empty());
    EXPECT_EQ(text_of(holders),
              holders[0].name + " (process " + std::to_string(other.process()) + ") holds it");
  }
  EXPECT_TRUE(holders_of(path).empty());
}

TEST(HoldersOf, AreNoneOfWhatIsNotThere) {
  EXPECT_TRUE(holders_of("/nonexistent/device").empty());
  EXPECT_EQ(text_of(std::vector<Holder>{}), "");
}

}  // namespace
}  // namespace veneer::capture
