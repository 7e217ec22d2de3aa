// SPDX-License-Identifier: Apache-2.0
#include "service/bus/testing/private_bus.h"

#include <fcntl.h>
#include <grp.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstring>
#include <thread>

#include "base/files.h"
#include "base/unique_handle.h"

namespace veneer::service {
namespace {

/// Of a system bus: names and calls are denied unless a file allows them; answers and signals are
/// not.
constexpr char kConfig[] =
    R"(<!DOCTYPE busconfig PUBLIC "-//freedesktop//DTD D-Bus Bus Configuration 1.0//EN"
 "http://www.freedesktop.org/standards/dbus/1.0/busconfig.dtd">
<busconfig>
  <type>system</type>
  <listen>unix:path={0}/bus</listen>
  <auth>EXTERNAL</auth>
  <policy context="default">
    <allow user="*"/>
    <deny own="*"/>
    <deny send_type="method_call"/>
    <allow send_type="signal"/>
    <allow send_requested_reply="true" send_type="method_return"/>
    <allow send_requested_reply="true" send_type="error"/>
    <allow receive_type="method_call"/>
    <allow receive_type="method_return"/>
    <allow receive_type="error"/>
    <allow receive_type="signal"/>
    <allow send_destination="org.freedesktop.DBus"
           send_interface="org.freedesktop.DBus"/>
    <allow send_destination="org.freedesktop.DBus"
           send_interface="org.freedesktop.DBus.Introspectable"/>
    <allow send_destination="org.freedesktop.DBus"
           send_interface="org.freedesktop.DBus.Properties"/>
  </policy>
{1}</busconfig>
)";

constexpr char kOpenPolicy[] = R"(<busconfig>
  <policy context="default">
    <allow own="*"/>
    <allow send_type="method_call"/>
  </policy>
</busconfig>
)";

bool answers(const std::string& socket_path) {
  const UniqueFd fd(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, socket_path.c_str(), sizeof(address.sun_path) - 1);
  return ::connect(fd.value(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0;
}

}  // namespace

PrivateBus::PrivateBus(const std::vector<std::filesystem::path>& policies)
    : config_(folder_.path() / "bus.conf") {
  ::chmod(folder_.path().c_str(), 0755);  // others than we are to reach the socket
  std::string includes;
  for (const std::filesystem::path& each : policies)
    includes += fmt::format("  <include>{}</include>\n", each.string());
  VENEER_CHECK(write_text(config_, fmt::format(kConfig, folder_.path().string(), includes)));
}

PrivateBus::~PrivateBus() { stop(); }

Status PrivateBus::start() {
  const std::string config = "--config-file=" + config_.string();
  const std::string log = (folder_.path() / "log").string();
  pid_ = ::fork();
  if (pid_ == 0) {
    ::prctl(PR_SET_PDEATHSIG, SIGTERM);  // never outlives a test that crashed
    ::dup2(::open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644), STDERR_FILENO);
    ::execlp("dbus-daemon", "dbus-daemon", config.c_str(), "--nofork", nullptr);
    ::_exit(127);
  }
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (std::chrono::steady_clock::now() < end) {
    if (answers((folder_.path() / "bus").string())) return {};
    int status = 0;
    if (::waitpid(pid_, &status, WNOHANG) == pid_) {
      pid_ = -1;
      return fail(Errc::kNotFound,
                  "dbus-daemon ended at once; is the package dbus-daemon there? {}",
                  read_text(log).value_or(""));
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return fail(Errc::kTimeout, "dbus-daemon does not answer");
}

void PrivateBus::stop() {
  if (pid_ <= 0) return;
  ::kill(pid_, SIGTERM);
  ::waitpid(pid_, nullptr, 0);
  pid_ = -1;
}

BusAddress PrivateBus::address() const {
  return BusAddress::parse("unix:path=" + (folder_.path() / "bus").string()).value();
}

std::filesystem::path shipped_policy() {
  return std::filesystem::path(VENEER_ETC) / "dbus-1/org.veneer.Veneer1.conf";
}

std::filesystem::path open_policy(const std::filesystem::path& folder) {
  std::filesystem::path path = folder / "open.conf";
  VENEER_CHECK(write_text(path, kOpenPolicy));
  return path;
}

Ran run_as(uid_t user, const std::vector<gid_t>& groups, const std::vector<std::string>& command) {
  int ends[2] = {-1, -1};
  VENEER_CHECK(::pipe2(ends, O_CLOEXEC) == 0);
  UniqueFd from(ends[0]);
  UniqueFd to(ends[1]);
  std::vector<char*> arguments;
  for (const std::string& each : command) arguments.push_back(const_cast<char*>(each.c_str()));
  arguments.push_back(nullptr);
  const bool switches = user != ::getuid() || !groups.empty();
  const pid_t child = ::fork();
  if (child == 0) {
    ::dup2(to.value(), STDOUT_FILENO);
    ::dup2(to.value(), STDERR_FILENO);
    if (switches && (::setgroups(groups.size(), groups.data()) != 0 || ::setgid(user) != 0 ||
                     ::setuid(user) != 0))
      ::_exit(126);
    ::execvp(arguments.front(), arguments.data());
    ::_exit(127);
  }
  to.reset();
  Ran ran;
  char buffer[4096];
  for (ssize_t n = 0; (n = ::read(from.value(), buffer, sizeof buffer)) > 0;)
    ran.output.append(buffer, static_cast<std::size_t>(n));
  int status = 0;
  ::waitpid(child, &status, 0);
  ran.status = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return ran;
}

}  // namespace veneer::service
