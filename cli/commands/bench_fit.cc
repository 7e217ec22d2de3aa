// SPDX-License-Identifier: Apache-2.0
#include "cli/commands/bench_fit.h"

#include <nlohmann/json.hpp>
#include <sys/resource.h>

#include <chrono>

#include "base/exit_code.h"
#include "base/parallel.h"
#include "btf/evaluation.h"
#include "btf/models/matrix_product.h"

namespace veneer::cli {
namespace {

double processor_seconds() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

struct TimedFit {
  double seconds = 0.0;
  double processor_seconds = 0.0;
  btf::Evaluation error;
};

Result<TimedFit> timed_fit(const btf::SampleSet& set,
                           const btf::Model& model,
                           const btf::FitOptions& options,
                           Progress& progress) {
  TimedFit result;
  const auto begin = std::chrono::steady_clock::now();
  const double used = processor_seconds();
  VENEER_ASSIGN(const std::unique_ptr<btf::Material> material, model.fit(set, options, progress));
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  result.processor_seconds = processor_seconds() - used;
  VENEER_ASSIGN(result.error, btf::evaluate(set, *material, progress));
  return result;
}

nlohmann::ordered_json json_of(const TimedFit& fit, int basis) {
  return {{"basis", basis},
          {"seconds", fit.seconds},
          {"processor_seconds", fit.processor_seconds},
          {"rmse_linear", fit.error.linear.rmse},
          {"rmse_encoded", fit.error.encoded.rmse},
          {"epsilon_encoded", fit.error.encoded.epsilon_avg}};
}

std::string row_of(std::string_view name, const TimedFit& fit) {
  return fmt::format("\n{:<10} {:>9.1f} {:>12.1f} {:>12.5f} {:>13.5f}",
                     name,
                     fit.seconds,
                     fit.processor_seconds,
                     fit.error.linear.rmse,
                     fit.error.encoded.rmse);
}

}  // namespace

Result<int> bench_fit(const std::filesystem::path& path,
                      const btf::Model& model,
                      const btf::FitOptions& options,
                      CommandLine& line) {
  if (!model.over_ranks)
    return fail(Errc::kInvalidOption, "bench fit: {} finds no clusters in a basis", model.name);
  VENEER_ASSIGN(const btf::SampleSet set, btf::SampleSet::open(path));
  // Untimed: the set is read from the disk, the BLAS started.
  VENEER_TRY(set.check_finite());
  VENEER_ASSIGN(const TimedFit reduced, timed_fit(set, model, options, line.progress()));
  btf::FitOptions full_options = options;
  full_options.basis = 0;
  VENEER_ASSIGN(const TimedFit full, timed_fit(set, model, full_options, line.progress()));

  const double speedup = full.seconds / reduced.seconds;
  const double processor_speedup = full.processor_seconds / reduced.processor_seconds;
  const double rmse_ratio = reduced.error.linear.rmse / full.error.linear.rmse;
  line.print(
      {{"set", path.string()},
       {"model", model.name},
       {"clusters", options.clusters},
       {"components", options.components},
       {"seed", options.seed},
       {"blas", btf::blas_description()},
       {"threads", thread_count()},
       {"reduced", json_of(reduced, options.basis)},
       {"full", json_of(full, 0)},
       {"speedup", speedup},
       {"processor_speedup", processor_speedup},
       {"rmse_ratio", rmse_ratio}},
      fmt::format("{} {}, {} clusters, {} threads, {}\n{:<10} {:>9} {:>12} {:>12} {:>13}{}{}\n"
                  "{:.1f} times faster ({:.1f} in processor seconds), rmse {:+.2f} %",
                  model.name,
                  options.components,
                  options.clusters,
                  thread_count(),
                  btf::blas_description(),
                  "",
                  "seconds",
                  "processor s",
                  "rmse linear",
                  "rmse encoded",
                  row_of(fmt::format("basis {}", options.basis), reduced),
                  row_of("full", full),
                  speedup,
                  processor_speedup,
                  100.0 * (rmse_ratio - 1.0)));
  return kExitDone;
}

}  // namespace veneer::cli
