// SPDX-License-Identifier: Apache-2.0
#include "service/front.h"

#include <spdlog/spdlog.h>

#include <condition_variable>
#include <mutex>
#include <thread>

#include "service/bus/bus_server.h"
#include "service/metrics/metrics.h"
#include "service/notify/notifier.h"

namespace veneer::service {
namespace {

/// How often it is looked whether a reload was asked for.
constexpr Duration kReloadPoll = std::chrono::milliseconds(100);

/// The daemon, with systemd told of every reload whoever asks for it.
class AnnouncedControl final : public ServiceControl {
 public:
  /// @param notifier  may be null.
  AnnouncedControl(ServiceControl& control, Notifier* notifier)
      : control_(control), notifier_(notifier) {}

  [[nodiscard]] ServiceStatus status() const override { return control_.status(); }
  [[nodiscard]] std::uint64_t frames() const override { return control_.frames(); }
  [[nodiscard]] std::uint64_t turns() const override { return control_.turns(); }
  [[nodiscard]] Status load_material(const std::filesystem::path& material) override {
    return control_.load_material(material);
  }
  [[nodiscard]] Status set_scene(const std::filesystem::path& scene) override {
    return control_.set_scene(scene);
  }
  [[nodiscard]] Status set_light(int index, const LightSetting& light) override {
    return control_.set_light(index, light);
  }
  [[nodiscard]] Status blank(bool on) override { return control_.blank(on); }
  [[nodiscard]] Status reload() override {
    if (notifier_ == nullptr) return control_.reload();
    notifier_->reloading();
    const Status done = control_.reload();
    notifier_->reloaded();
    return done;
  }
  [[nodiscard]] Result<std::filesystem::path> snapshot() override { return control_.snapshot(); }

 private:
  ServiceControl& control_;
  Notifier* notifier_;
};

class FrontImpl final : public Front {
 public:
  FrontImpl(ServiceControl& control, const FrontOptions& options)
      : notifier_(Notifier::start(control)),
        control_(control, notifier_.get()),
        reload_requested_(options.reload_requested) {
    start_bus(options.bus);
    if (options.metrics_port != 0)
      keep(MetricsPort::open(control_, options.metrics_port), metrics_port_);
    if (!options.metrics_file.empty())
      keep(MetricsFile::open(control_, options.metrics_file), metrics_file_);
    if (reload_requested_ != nullptr) reloader_ = std::thread([this] { run(); });
  }

  ~FrontImpl() override {
    if (notifier_) notifier_->stopping();
    {
      const std::scoped_lock lock(mutex_);
      stop_ = true;
    }
    wake_.notify_all();
    if (reloader_.joinable()) reloader_.join();
  }

 private:
  void start_bus(const std::string& name) {
    if (name == "none" || name.empty()) return;
    const Result<BusAddress> address = BusAddress::parse(name);
    if (!address) return spdlog::warn("service.bus: {}", address.error().what);
    BusOptions options;
    options.address = *address;
    options.keep_trying = true;
    keep(BusServer::start(control_, options), bus_);
  }

  template <class T>
  static void keep(Result<std::unique_ptr<T>> part, std::unique_ptr<T>& place) {
    if (part) {
      place = std::move(*part);
    } else {
      spdlog::warn("{}; the service goes on without", part.error().what);
    }
  }

  void run() {
    std::unique_lock lock(mutex_);
    while (!wake_.wait_for(lock, kReloadPoll, [this] { return stop_; })) {
      if (!reload_requested_->exchange(false)) continue;
      lock.unlock();
      if (const Status done = control_.reload(); !done)
        spdlog::warn("the reload is refused, all stays as it was: {}", done.error().what);
      lock.lock();
    }
  }

  std::unique_ptr<Notifier> notifier_;  // outlives whoever may reload
  AnnouncedControl control_;
  std::atomic<bool>* reload_requested_;
  std::unique_ptr<BusServer> bus_;
  std::unique_ptr<MetricsPort> metrics_port_;
  std::unique_ptr<MetricsFile> metrics_file_;

  std::mutex mutex_;
  std::condition_variable wake_;
  bool stop_ = false;
  std::thread reloader_;
};

}  // namespace

Status FrontOptions::check() const {
  if (bus != "none")
    if (const auto address = BusAddress::parse(bus); !address)
      return fail_while("service.bus", address.error());
  if (metrics_port < 0 || metrics_port > 65535)
    return fail(Errc::kInvalidOption,
                "service.metrics_port: {} is no port; 1 to 65535 are, and 0 for none",
                metrics_port);
  if (!metrics_file.empty() && (!metrics_file.is_absolute() || metrics_file.extension() != ".prom"))
    return fail(Errc::kInvalidOption,
                "service.metrics_file: {} has to be absolute and to end with .prom",
                metrics_file.string());
  return {};
}

std::unique_ptr<Front> Front::start(ServiceControl& control, const FrontOptions& options) {
  return std::make_unique<FrontImpl>(control, options);
}

}  // namespace veneer::service
