// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <functional>
#include <string>

#include "base/result.h"
#include "base/testing/temporary_folder.h"
#include "service/bus/bus_address.h"

namespace veneer::service {

/// For tests: a dbus-daemon of one's own, which can be stopped and started again under the same
/// address. Its base policy is the one of a system bus: nothing is allowed that no file allows.
class PrivateBus {
 public:
  /// @param policies  files whose rules are added.
  explicit PrivateBus(const std::vector<std::filesystem::path>& policies);
  ~PrivateBus();
  PrivateBus(const PrivateBus&) = delete;
  PrivateBus& operator=(const PrivateBus&) = delete;

  /// Errors: kNotFound (no dbus-daemon on this machine), kIo, kTimeout.
  [[nodiscard]] Status start();
  void stop();
  [[nodiscard]] BusAddress address() const;

 private:
  TemporaryFolder folder_;
  std::filesystem::path config_;
  pid_t pid_ = -1;
};

/// etc/dbus-1/org.veneer.Veneer1.conf, as it is installed.
[[nodiscard]] std::filesystem::path shipped_policy();
/// One that lets everybody do everything.
[[nodiscard]] std::filesystem::path open_policy(const std::filesystem::path& folder);

/// What a program says (both streams) and its exit status, run as somebody else: in a child with
/// this user and these groups. Needs root for any but one's own.
struct Ran {
  int status = -1;
  std::string output;
};
[[nodiscard]] Ran run_as(uid_t user,
                         const std::vector<gid_t>& groups,
                         const std::vector<std::string>& command);

}  // namespace veneer::service
