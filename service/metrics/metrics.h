// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "base/clock.h"
#include "service/control.h"

namespace veneer::service {

/// The status in Prometheus' text format; docs/howto/service.md lists the names.
[[nodiscard]] std::string metrics_text(const ServiceStatus& status);

/// Answers Prometheus over HTTP, at http://127.0.0.1:PORT/metrics and nowhere else: whoever is to
/// see it from outside goes through a proxy that knows them. status() is asked once a scrape, on a
/// thread of its own. Its end may take two seconds: CivetWeb looks that often whether it is over.
class MetricsPort {
 public:
  /// @param control  borrowed; must outlive it.
  /// @param port     0: any that is free.
  /// Errors: kInvalidOption (no port), kUnavailable (it is taken).
  [[nodiscard]] static Result<std::unique_ptr<MetricsPort>> open(const ServiceControl& control,
                                                                 int port);
  virtual ~MetricsPort() = default;
  [[nodiscard]] virtual int port() const = 0;
};

/// Writes a file for node_exporter's textfile collector, whole or not at all, again and again. The
/// destructor removes it: a service that does not run has no figures.
class MetricsFile {
 public:
  /// @param control  borrowed; must outlive it.
  /// @param path     absolute, ends with ".prom", or the collector would not read it.
  /// Errors: kInvalidOption, kIo (it cannot be written there now). A later failure is logged, once
  /// until it is over.
  [[nodiscard]] static Result<std::unique_ptr<MetricsFile>> open(
      const ServiceControl& control,
      const std::filesystem::path& path,
      Duration period = std::chrono::seconds(10));
  virtual ~MetricsFile() = default;
};

}  // namespace veneer::service
