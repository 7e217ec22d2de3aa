// SPDX-License-Identifier: Apache-2.0
// The policy that is shipped, held by a dbus-daemon of our own against clients of several users.
#include <gmock/gmock.h>
#include <grp.h>
#include <gtest/gtest.h>
#include <pwd.h>
#include <systemd/sd-bus.h>
#include <unistd.h>

#include <cstdlib>

#include "base/files.h"
#include "service/bus/bus_client.h"
#include "service/bus/bus_server.h"
#include "service/bus/internal_properties.h"
#include "service/bus/names.h"
#include "service/bus/testing/private_bus.h"
#include "service/testing/fake_control.h"

namespace veneer::service {
namespace {

using testing::HasSubstr;

/// Every method, and arguments as busctl takes them.
const std::vector<std::vector<std::string>> kCalls{
    {"LoadMaterial", "s", "/a"},
    {"SetScene", "s", "/a"},
    {"SetLight", "i(ddd)d(ddd)", "0", "0", "0", "1", "1", "1", "1", "1"},
    {"Blank", "b", "true"},
    {"Reload"},
    {"Snapshot"}};

class PolicyTest : public testing::Test {
 protected:
  void SetUp() override {
    if (::getuid() != 0) GTEST_SKIP() << "needs root, to be several users";
    const passwd* const nobody = ::getpwnam("nobody");
    ASSERT_NE(nobody, nullptr);
    nobody_ = nobody->pw_uid;
    // A machine that only builds Veneer lacks its group: another stands in for it.
    std::string policy = read_text(shipped_policy()).value();
    const group* member_group = ::getgrnam("veneer");
    if (member_group == nullptr) {
      member_group = ::getgrnam("games");
      ASSERT_NE(member_group, nullptr);
      const std::string from = "group=\"veneer\"";
      ASSERT_NE(policy.find(from), std::string::npos);
      policy.replace(policy.find(from), from.size(), "group=\"games\"");
    }
    members_ = member_group->gr_gid;
    const std::filesystem::path path = folder_.path() / "policy.conf";
    ASSERT_TRUE(write_text(path, policy));
    bus_ = std::make_unique<PrivateBus>(std::vector{path});
    const Status started = bus_->start();
    ASSERT_TRUE(started) << started.error().what;
    BusOptions options;
    options.address = bus_->address();
    control_.change([](ServiceStatus& s) { s = busy_status(); });
    auto server = BusServer::start(control_, options);
    ASSERT_TRUE(server) << server.error().what;
    server_ = std::move(*server);
  }

  Ran busctl(uid_t user,
             const std::vector<gid_t>& groups,
             const std::string& verb,
             const std::vector<std::string>& arguments) {
    std::vector<std::string> command{
        "busctl", "--address=" + bus_->address().text(), verb, kBusName, kObjectPath};
    command.insert(command.end(), arguments.begin(), arguments.end());
    return run_as(user, groups, command);
  }
  Ran call(uid_t user, const std::vector<gid_t>& groups, std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), kInterface);
    return busctl(user, groups, "call", arguments);
  }

  TemporaryFolder folder_;
  FakeControl control_;
  std::unique_ptr<PrivateBus> bus_;
  std::unique_ptr<BusServer> server_;
  uid_t nobody_ = 0;
  gid_t members_ = 0;
};

TEST_F(PolicyTest, LetsAStrangerReadEverything) {
  for (const Property& each : properties()) {
    const Ran ran = busctl(nobody_, {}, "get-property", {kInterface, each.name});
    EXPECT_EQ(ran.status, 0) << each.name << ": " << ran.output;
    EXPECT_THAT(ran.output, testing::StartsWith(each.signature + " ")) << each.name;
  }
  const Ran introspected = busctl(nobody_, {}, "introspect", {});
  EXPECT_EQ(introspected.status, 0) << introspected.output;
  for (const Property& each : properties()) EXPECT_THAT(introspected.output, HasSubstr(each.name));
  for (const auto& each : kCalls) EXPECT_THAT(introspected.output, HasSubstr("." + each.front()));
  EXPECT_EQ(busctl(nobody_, {}, "call", {"org.freedesktop.DBus.Peer", "Ping"}).status, 0);
}

TEST_F(PolicyTest, RefusesAStrangerEveryMethod) {
  for (const auto& each : kCalls) {
    const Ran ran = call(nobody_, {}, each);
    EXPECT_NE(ran.status, 0) << each.front();
    EXPECT_THAT(ran.output, HasSubstr("Access denied")) << each.front();
  }
  const Ran set = busctl(nobody_, {}, "set-property", {kInterface, "State", "s", "running"});
  EXPECT_THAT(set.output, HasSubstr("Access denied"));
  EXPECT_TRUE(control_.told().empty());
}

TEST_F(PolicyTest, LetsRootAndTheGroupDoEverything) {
  std::size_t told = 0;
  for (const std::vector<gid_t>& groups : {std::vector<gid_t>{}, std::vector<gid_t>{members_}}) {
    const uid_t user = groups.empty() ? 0 : nobody_;
    for (const auto& each : kCalls) {
      const Ran ran = call(user, groups, each);
      EXPECT_EQ(ran.status, 0) << each.front() << " as " << user << ": " << ran.output;
      EXPECT_EQ(control_.told().size(), ++told) << each.front();
    }
  }
}

TEST_F(PolicyTest, LetsNobodyTakeTheName) {
  server_.reset();
  const Ran ran = run_as(nobody_,
                         {members_},
                         {"busctl",
                          "--address=" + bus_->address().text(),
                          "call",
                          "org.freedesktop.DBus",
                          "/org/freedesktop/DBus",
                          "org.freedesktop.DBus",
                          "RequestName",
                          "su",
                          kBusName,
                          "0"});
  EXPECT_NE(ran.status, 0);
  EXPECT_THAT(ran.output, HasSubstr("Access denied"));
}

/// Runs in a program of its own, as another user: see the next test.
TEST(Stranger, DISABLED_IsToldHowToBecomeAMember) {
  const char* const address = std::getenv("VENEER_TEST_BUS");
  ASSERT_NE(address, nullptr);
  BusClient client = BusClient::connect(BusAddress::parse(address).value()).value();
  EXPECT_EQ(client.status().value().faults, busy_status().faults);
  const auto told = client.tell(Blank{true});
  ASSERT_FALSE(told);
  EXPECT_EQ(told.error().code, Errc::kUnavailable);
  EXPECT_THAT(told.error().what, HasSubstr("group veneer"));

  // A call need not name its interface, and is refused all the same.
  sd_bus* bus = nullptr;
  ASSERT_GE(sd_bus_new(&bus), 0);
  ASSERT_GE(sd_bus_set_address(bus, address), 0);
  ASSERT_GE(sd_bus_set_bus_client(bus, 1), 0);
  ASSERT_GE(sd_bus_start(bus), 0);
  sd_bus_error error = SD_BUS_ERROR_NULL;
  EXPECT_LT(
      sd_bus_call_method(bus, kBusName, kObjectPath, nullptr, "Blank", &error, nullptr, "b", 1), 0);
  EXPECT_STREQ(error.name, "org.freedesktop.DBus.Error.AccessDenied");
  sd_bus_error_free(&error);
  sd_bus_flush_close_unref(bus);
}

TEST_F(PolicyTest, IsHeldAgainstOurOwnClientToo) {
  const std::string self = std::filesystem::read_symlink("/proc/self/exe").string();
  const Ran ran = run_as(nobody_,
                         {},
                         {"env",
                          "-u",
                          "GTEST_OUTPUT",
                          "VENEER_TEST_BUS=" + bus_->address().text(),
                          self,
                          "--gtest_also_run_disabled_tests",
                          "--gtest_filter=Stranger.*"});
  if (ran.output.find("Permission denied") != std::string::npos)
    GTEST_SKIP() << "nobody may not run " << self;
  EXPECT_EQ(ran.status, 0) << ran.output;
  EXPECT_THAT(ran.output, HasSubstr("[  PASSED  ] 1 test"));
  EXPECT_TRUE(control_.told().empty());
}

}  // namespace
}  // namespace veneer::service
