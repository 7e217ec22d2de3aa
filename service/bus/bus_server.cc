// SPDX-License-Identifier: Apache-2.0
#include "service/bus/bus_server.h"

#include <poll.h>
#include <spdlog/spdlog.h>
#include <sys/eventfd.h>

#include <algorithm>
#include <atomic>
#include <map>
#include <optional>
#include <thread>

#include "service/bus/command_queue.h"
#include "service/bus/internal_connection.h"
#include "service/bus/internal_properties.h"
#include "service/bus/names.h"

namespace veneer::service {
namespace {

/// The bus's own answers come within milliseconds; one that takes longer is not well.
constexpr Duration kBusTimeout = std::chrono::seconds(2);
/// Properties that are asked for together come from one status.
constexpr Duration kFresh = std::chrono::milliseconds(2);

/// Whoever floods us does not keep changes from being told.
constexpr int kMostInARow = 64;

Time now() { return SteadyClock().now(); }

/// A method: its name, what goes in and out, and how it becomes a command.
struct Method {
  std::string name;
  std::string in;
  std::vector<std::string> in_names;
  std::string out;
  std::vector<std::string> out_names;
  Command (*read)(sdbus::MethodCall&);
};

using Triple = sdbus::Struct<double, double, double>;

Eigen::Vector3d vector_of(const Triple& t) {
  return {std::get<0>(t), std::get<1>(t), std::get<2>(t)};
}

Command read_light(sdbus::MethodCall& call) {
  std::int32_t index = 0;
  Triple direction;
  double lux = 0;
  Triple colour;
  call >> index >> direction >> lux >> colour;
  return SetLight{index, {vector_of(direction), lux, vector_of(colour)}};
}

template <class T>
Command read_path(sdbus::MethodCall& call) {
  std::string path;
  call >> path;
  return T{std::move(path)};
}

Command read_blank(sdbus::MethodCall& call) {
  bool on = true;
  call >> on;
  return Blank{on};
}

const std::vector<Method>& methods() {
  static const std::vector<Method> kMethods{
      {"LoadMaterial", "s", {"path"}, "", {}, &read_path<LoadMaterial>},
      {"SetScene", "s", {"path"}, "", {}, &read_path<SetScene>},
      {"SetLight",
       "i(ddd)d(ddd)",
       {"index", "direction_to_light", "illuminance_lux", "colour"},
       "",
       {},
       &read_light},
      {"Blank", "b", {"on"}, "", {}, &read_blank},
      {"Reload", "", {}, "", {}, [](sdbus::MethodCall&) { return Command(Reload{}); }},
      {"Snapshot", "", {}, "s", {"path"}, [](sdbus::MethodCall&) { return Command(Snapshot{}); }},
  };
  return kMethods;
}

sdbus::Error wire_error(const Error& error) {
  return {error_name_of(error.code), readable(error.what)};
}

class BusServerImpl final : public BusServer {
 public:
  BusServerImpl(ServiceControl& control, BusOptions options)
      : control_(control),
        options_(std::move(options)),
        wake_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
        queue_(control) {}

  ~BusServerImpl() override {
    stop_ = true;
    ::eventfd_write(wake_.value(), 1);
    if (thread_.joinable()) thread_.join();
    disconnect();
  }

  Status begin() {
    retry_ = options_.first_retry;
    if (const Status connected = connect(); !connected) {
      if (!options_.keep_trying) return connected;
      spdlog::warn("{}; the service goes on without it and tries again", connected.error().what);
      said_ = connected.error().what;
    }
    thread_ = std::thread([this] { run(); });
    return {};
  }

  [[nodiscard]] bool connected() const override { return connected_; }

 private:
  Status connect() {
    auto connection = connect_to(options_.address, kBusTimeout);
    if (!connection) return tl::unexpected(connection.error());
    connection_ = std::move(*connection);
    try {
      offer();
      // Last: whoever waits for the name finds everything there.
      connection_->requestName(kBusName);
    } catch (const sdbus::Error& error) {
      disconnect();
      return fail(Errc::kUnavailable,
                  "taking the name {} on {}: {}",
                  kBusName,
                  options_.address.name(),
                  reason(error));
    }
    told_ = status_ = control_.status();
    polled_ = figures_told_ = now();
    connected_ = true;
    return {};
  }

  static std::string reason(const sdbus::Error& error) {
    if (error.getName() == "org.freedesktop.DBus.Error.FileExists")
      return "somebody has it; is another veneerd running? systemctl status veneerd";
    if (error.getName() == "org.freedesktop.DBus.Error.AccessDenied")
      return "the bus does not let this user have it; is "
             "/usr/share/dbus-1/system.d/org.veneer.Veneer1.conf installed, and is this the user "
             "veneer?";
    return error.getMessage();
  }

  void disconnect() {
    connected_ = false;
    waiting_.clear();  // before the connection: its messages point to it
    object_.reset();
    connection_.reset();
  }

  void offer() {
    object_ = sdbus::createObject(*connection_, kObjectPath);
    for (const Property& each : properties())
      object_->registerProperty(
          kInterface, each.name, each.signature, [this, &each](sdbus::PropertyGetReply& reply) {
            refresh(kFresh);
            each.append(reply, status_);
          });
    for (const Method& each : methods())
      object_->registerMethod(kInterface,
                              each.name,
                              each.in,
                              each.in_names,
                              each.out,
                              each.out_names,
                              [this, &each](sdbus::MethodCall call) { take(each, call); });
    object_->finishRegistration();
  }

  void take(const Method& method, sdbus::MethodCall& call) {
    const Command command = method.read(call);
    spdlog::info("the bus: {} asks for {}", call.getSender(), text_of(command));
    const std::uint64_t id = ++last_id_;
    if (const Status submitted = queue_.submit(id, command); !submitted) {
      spdlog::warn("the bus: {}", submitted.error().what);
      call.createErrorReply(wire_error(submitted.error())).send();
      return;
    }
    waiting_.emplace(id, Waiting{std::move(call), &method});
  }

  void answer() {
    for (CommandQueue::Done& done : queue_.take_done()) {
      if (!done.result) spdlog::warn("the bus: {}", done.result.error().what);
      const auto found = waiting_.find(done.id);
      if (found == waiting_.end()) continue;  // asked on a connection that is gone
      const Waiting waiting = std::move(found->second);
      waiting_.erase(found);
      refresh(Duration{0});
      if (!done.result) {
        waiting.call.createErrorReply(wire_error(done.result.error())).send();
        continue;
      }
      sdbus::MethodReply reply = waiting.call.createReply();
      if (!waiting.method->out.empty()) reply << readable(*done.result);
      reply.send();
    }
  }

  /// Has a status that is no older than `age`.
  void refresh(Duration age) {
    const Time time = now();
    if (time - polled_ < age) return;
    status_ = control_.status();
    polled_ = time;
  }

  /// Signals what has changed since it was told last.
  void tell() {
    const Time time = now();
    const bool figures = time - figures_told_ >= options_.figures;
    std::vector<std::string> changed;
    for (const Property& each : properties())
      if ((each.urgent || figures) && !each.same(told_, status_)) changed.push_back(each.name);
    if (figures) {
      told_ = status_;
      figures_told_ = time;
    } else {
      told_.state = status_.state;
      told_.faults = status_.faults;
    }
    if (!changed.empty()) object_->emitPropertiesChangedSignal(kInterface, changed);
  }

  void run() {
    Time next_try = now() + retry_;
    while (!stop_) {
      if (connection_) {
        const std::optional<std::string> lost = serve();
        if (!lost) continue;
        disconnect();
        spdlog::warn(
            "{} is gone ({}); the service goes on and tries again", options_.address.name(), *lost);
        retry_ = options_.first_retry;
        next_try = now() + retry_;
      }
      if (now() < next_try) {
        wait_for({{wake_.value(), POLLIN, 0}}, next_try);
        continue;
      }
      if (const Status back = connect(); back) {
        spdlog::info("back on {}", options_.address.name());
        said_.clear();
      } else {
        // Once a reason, not once an attempt.
        if (back.error().what != said_) spdlog::warn("{}; trying again", back.error().what);
        said_ = back.error().what;
        retry_ = std::min(2 * retry_, options_.last_retry);
        next_try = now() + retry_;
      }
    }
  }

  /// One turn. Returns why the bus is gone, if it is.
  std::optional<std::string> serve() {
    try {
      for (int i = 0; i < kMostInARow && !stop_ && connection_->processPendingRequest(); ++i) {
      }
      answer();
      refresh(options_.poll);
      tell();
      const sdbus::IConnection::PollData bus = connection_->getEventLoopPollData();
      Time until = polled_ + options_.poll;
      if (const auto timeout = bus.getRelativeTimeout())
        until = std::min(until, now() + Duration(*timeout));
      const short revents = wait_for(
          {{bus.fd, bus.events, 0}, {queue_.done_fd(), POLLIN, 0}, {wake_.value(), POLLIN, 0}},
          until);
      if ((revents & (POLLHUP | POLLERR | POLLNVAL)) != 0 && (revents & POLLIN) == 0)
        return "it hung up";
      return {};
    } catch (const sdbus::Error& error) {
      return error.getMessage();
    }
  }

  /// What happened to the first of them.
  static short wait_for(std::vector<pollfd> fds, Time until) {
    const Duration left = std::max(until - now(), Duration{0});
    const auto ms = std::chrono::ceil<std::chrono::milliseconds>(left).count();
    ::poll(fds.data(), fds.size(), static_cast<int>(std::min<std::int64_t>(ms, 60'000)));
    return fds.front().revents;
  }

  struct Waiting {
    sdbus::MethodCall call;
    const Method* method;
  };

  ServiceControl& control_;
  const BusOptions options_;
  UniqueFd wake_;
  std::atomic<bool> stop_{false};
  std::atomic<bool> connected_{false};
  CommandQueue queue_;

  // What follows is the thread's own.
  std::unique_ptr<sdbus::IConnection> connection_;
  std::unique_ptr<sdbus::IObject> object_;
  std::uint64_t last_id_ = 0;
  std::map<std::uint64_t, Waiting> waiting_;
  ServiceStatus status_;  // as of polled_
  ServiceStatus told_;    // what was last signalled
  Time polled_;
  Time figures_told_;
  Duration retry_{0};
  std::string said_;  // why there is no bus, as it was logged last

  std::thread thread_;
};

}  // namespace

Result<std::unique_ptr<BusServer>> BusServer::start(ServiceControl& control,
                                                    const BusOptions& options) {
  auto server = std::make_unique<BusServerImpl>(control, options);
  VENEER_TRY(server->begin());
  return server;
}

}  // namespace veneer::service
