// SPDX-License-Identifier: Apache-2.0
#include "service/metrics/metrics.h"

#include <prometheus/collectable.h>
#include <prometheus/exposer.h>
#include <prometheus/metric_family.h>
#include <prometheus/text_serializer.h>
#include <spdlog/spdlog.h>

#include <condition_variable>
#include <mutex>
#include <thread>
#include <vector>

#include "base/files.h"
#include "service/bus/command.h"

namespace veneer::service {
namespace {

using prometheus::ClientMetric;
using prometheus::MetricFamily;
using prometheus::MetricType;

constexpr double kSecondsPerMillisecond = 1e-3;

MetricFamily family(const char* name, const char* help, MetricType type) {
  MetricFamily result;
  result.name = name;
  result.help = help;
  result.type = type;
  return result;
}

ClientMetric gauge(double value, std::vector<ClientMetric::Label> labels = {}) {
  ClientMetric metric;
  metric.label = std::move(labels);
  metric.gauge.value = value;
  return metric;
}

MetricFamily one_gauge(const char* name, const char* help, double value) {
  MetricFamily result = family(name, help, MetricType::Gauge);
  result.metric = {gauge(value)};
  return result;
}

MetricFamily one_counter(const char* name, const char* help, std::uint64_t value) {
  MetricFamily result = family(name, help, MetricType::Counter);
  ClientMetric metric;
  metric.counter.value = static_cast<double>(value);
  result.metric = {metric};
  return result;
}

bool has(const ServiceStatus& status, FaultKind kind) {
  for (const Fault& each : status.faults)
    if (each.kind == kind) return true;
  return false;
}

/// Every state and fault is there all the time, as 0 or 1: a series that only comes with the
/// trouble is one that an alarm cannot be tried on.
std::vector<MetricFamily> families_of(const ServiceStatus& status) {
  std::vector<MetricFamily> families;
  MetricFamily states = family("veneer_state", "1 for the state it is in", MetricType::Gauge);
  for (std::size_t i = 0; i < kStateCount; ++i) {
    const auto state = static_cast<State>(i);
    states.metric.push_back(
        gauge(state == status.state ? 1 : 0, {{"state", std::string(name_of(state))}}));
  }
  families.push_back(std::move(states));

  MetricFamily faults = family("veneer_fault", "1 while there is such a fault", MetricType::Gauge);
  for (std::size_t i = 0; i < kFaultKindCount; ++i) {
    const auto kind = static_cast<FaultKind>(i);
    faults.metric.push_back(
        gauge(has(status, kind) ? 1 : 0, {{"kind", std::string(name_of(kind))}}));
  }
  families.push_back(std::move(faults));

  MetricFamily latency = family("veneer_latency_seconds",
                                "From a pose to its light, by stage; medians over the last second",
                                MetricType::Gauge);
  for (const LatencyStage& stage : kLatencyStages)
    latency.metric.push_back(gauge(status.latency_ms.*stage.milliseconds * kSecondsPerMillisecond,
                                   {{"stage", std::string(stage.name)}}));
  families.push_back(std::move(latency));

  MetricFamily frame = family(
      "veneer_frame_seconds", "Time to make a frame, over the last second", MetricType::Gauge);
  frame.metric = {gauge(status.frame_ms_median * kSecondsPerMillisecond, {{"quantile", "0.5"}}),
                  gauge(status.frame_ms_p95 * kSecondsPerMillisecond, {{"quantile", "0.95"}})};
  families.push_back(std::move(frame));

  families.push_back(one_gauge("veneer_gpu_seconds",
                               "The GPU's part of a frame, median over the last second",
                               status.gpu_ms_median * kSecondsPerMillisecond));
  families.push_back(one_gauge(
      "veneer_frame_rate_hertz", "Frames a second, over the last second", status.frame_rate_hz));
  families.push_back(one_gauge("veneer_luminance_ceiling_candelas_per_square_metre",
                               "No brighter than this is shown; 0 for no ceiling",
                               status.luminance_ceiling));
  families.push_back(one_gauge("veneer_quality_rung",
                               "How far down the ladder the picture is drawn; 0 is the best",
                               status.quality_rung));
  families.push_back(one_counter("veneer_frames_total",
                                 "Frames that went out since the start, dark ones included",
                                 status.frames));
  families.push_back(one_counter(
      "veneer_frames_dropped_total", "Refreshes for which no frame was ready", status.dropped));
  families.push_back(one_counter(
      "veneer_frames_late_total", "Frames that took longer than a period to make", status.late));
  families.push_back(
      one_counter("veneer_faults_recovered_total", "Faults that were overcome", status.recovered));

  MetricFamily info =
      family("veneer_info", "What is shown, and by what; always 1", MetricType::Gauge);
  info.metric = {gauge(1,
                       {{"material", readable(status.material)},
                        {"output", readable(status.output)},
                        {"profile", readable(status.profile)},
                        {"quality", readable(status.quality)},
                        {"renderer", readable(status.renderer)},
                        {"scene", readable(status.scene)}})};
  families.push_back(std::move(info));
  return families;
}

class StatusCollector final : public prometheus::Collectable {
 public:
  explicit StatusCollector(const ServiceControl& control) : control_(control) {}
  [[nodiscard]] std::vector<MetricFamily> Collect() const override {
    return families_of(control_.status());
  }

 private:
  const ServiceControl& control_;
};

class MetricsPortImpl final : public MetricsPort {
 public:
  /// Throws where the port cannot be had.
  MetricsPortImpl(const ServiceControl& control, int port)
      : collector_(std::make_shared<StatusCollector>(control)),
        exposer_(fmt::format("127.0.0.1:{}", port), 1) {
    exposer_.RegisterCollectable(collector_);
  }
  [[nodiscard]] int port() const override { return exposer_.GetListeningPorts().at(0); }

 private:
  std::shared_ptr<StatusCollector> collector_;  // shared: the exposer holds it weakly
  prometheus::Exposer exposer_;
};

class MetricsFileImpl final : public MetricsFile {
 public:
  MetricsFileImpl(const ServiceControl& control, std::filesystem::path path, Duration period)
      : control_(control), path_(std::move(path)), period_(period) {}

  ~MetricsFileImpl() override {
    {
      const std::scoped_lock lock(mutex_);
      stop_ = true;
    }
    wake_.notify_all();
    if (!thread_.joinable()) return;
    thread_.join();
    std::error_code ignored;
    std::filesystem::remove(path_, ignored);
  }

  Status begin() {
    VENEER_TRY(write());
    thread_ = std::thread([this] { run(); });
    return {};
  }

 private:
  [[nodiscard]] Status write() const { return write_text(path_, metrics_text(control_.status())); }

  void run() {
    bool failing = false;
    std::unique_lock lock(mutex_);
    while (!wake_.wait_for(lock, period_, [this] { return stop_; })) {
      lock.unlock();
      const Status written = write();
      if (!written && !failing) spdlog::warn("the metrics file: {}", written.error().what);
      if (written && failing) spdlog::info("the metrics file is written again");
      failing = !written;
      lock.lock();
    }
  }

  const ServiceControl& control_;
  const std::filesystem::path path_;
  const Duration period_;
  std::mutex mutex_;
  std::condition_variable wake_;
  bool stop_ = false;
  std::thread thread_;
};

}  // namespace

std::string metrics_text(const ServiceStatus& status) {
  return prometheus::TextSerializer().Serialize(families_of(status));
}

Result<std::unique_ptr<MetricsPort>> MetricsPort::open(const ServiceControl& control, int port) {
  if (port < 0 || port > 65535)
    return fail(Errc::kInvalidOption, "offering metrics: {} is no port; 1 to 65535 are", port);
  try {
    return std::make_unique<MetricsPortImpl>(control, port);
  } catch (const std::exception&) {  // its text names neither the port nor the reason
    return fail(Errc::kUnavailable,
                "offering metrics: the port 127.0.0.1:{} cannot be had; another program has it, or "
                "it is for root alone: choose another as service.metrics_port",
                port);
  }
}

Result<std::unique_ptr<MetricsFile>> MetricsFile::open(const ServiceControl& control,
                                                       const std::filesystem::path& path,
                                                       Duration period) {
  if (!path.is_absolute() || path.extension() != ".prom")
    return fail(Errc::kInvalidOption,
                "writing metrics: {} has to be absolute and to end with .prom",
                readable(path.string()));
  auto file = std::make_unique<MetricsFileImpl>(control, path, period);
  if (const Status begun = file->begin(); !begun)
    return fail_while("writing metrics", begun.error());
  return file;
}

}  // namespace veneer::service
