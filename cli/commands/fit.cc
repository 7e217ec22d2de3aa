// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include <chrono>

#include "base/exit_code.h"
#include "btf/material.h"
#include "cli/commands/commands.h"
#include "cli/ranks/ranks.h"

namespace veneer::cli {
namespace {

struct FitRequest {
  std::filesystem::path set;
  std::filesystem::path out;
  std::string model;
  btf::FitOptions options;
};

struct FitReport {
  double seconds = 0.0;
  std::size_t gpu_bytes = 0;
  int fetches = 0;
};

// What every rank does; rank 0 writes the material.
Result<FitReport> fit(const FitRequest& request, btf::Communicator& ranks, Progress& progress) {
  VENEER_ASSIGN(const btf::Model* model, btf::find_model(request.model));
  if (ranks.size() > 1 && !model->over_ranks)
    return fail(
        Errc::kInvalidOption,
        "fit: {} is not shared among processes, of which there are {}; run it without mpirun",
        request.model,
        ranks.size());
  const Result<btf::SampleSet> set = btf::SampleSet::open(request.set);
  VENEER_TRY(btf::agree(ranks, set ? Status() : tl::unexpected(set.error())));
  const auto begin = std::chrono::steady_clock::now();
  VENEER_ASSIGN(const std::unique_ptr<btf::Material> material,
                model->fit(*set, request.options, progress));
  FitReport report;
  report.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  Status saved;
  if (ranks.rank() == 0) {
    saved = btf::save_material(*material,
                               request.out,
                               {{"fitted_on", set->info().source},
                                {"clusters", std::to_string(request.options.clusters)},
                                {"components", request.options.components},
                                {"seed", std::to_string(request.options.seed)}});
    const btf::ModelShader shader = material->shader();
    report.gpu_bytes = shader.gpu_bytes();
    report.fetches = shader.fetches;
  }
  VENEER_TRY(btf::agree(ranks, saved));
  return report;
}

}  // namespace

Result<int> run_fit(CommandLine& line) {
  FitRequest request;
  btf::FitOptions& options = request.options;
  std::string names;
  for (const btf::Model& model : btf::models())
    names += fmt::format("\n  {}: {}", model.name, model.summary);
  CLI::App& app = line.app();
  app.add_option("set", request.set, "The sample set, NAME.btfset")->required();
  app.add_option("-o,--output", request.out, "The material to write, NAME.safetensors")->required();
  app.add_option("--model", request.model, "The model:" + names)->required();
  app.add_option("--clusters", options.clusters, "Clusters of texels")->capture_default_str();
  app.add_option("--components", options.components, "Eigen-BRDFs per texel, such as 4 or 3+1")
      ->capture_default_str();
  app.add_option("--lobes", options.lobes, "Lobes of a texel, for models made of them")
      ->capture_default_str();
  app.add_option("--form",
                 options.form,
                 "How terms are put together; dichromatic-lpca: learned, ratio, subtractive");
  app.add_option("--specular",
                 options.specular,
                 "How dichromatic-lpca keeps its specular term: product, half-angle, measured");
  app.add_option("--clustering",
                 options.clustering,
                 "Clusters of dichromatic-lpca's two terms: joint, separate, measured");
  app.add_option("--precision", options.precision, "8bit or float16, for models that offer both");
  app.add_option("--angular", options.angular, "Nodes along each side of the direction square")
      ->capture_default_str();
  app.add_option("--iterations", options.iterations, "Rounds of clustering at most")
      ->capture_default_str();
  app.add_option("--seed", options.seed, "Seed of everything random")->capture_default_str();
  line.parse();

  VENEER_ASSIGN(const std::unique_ptr<btf::Communicator> ranks, connect_ranks());
  options.ranks = ranks.get();
  SilentProgress silent;
  const Result<FitReport> report =
      fit(request, *ranks, ranks->rank() == 0 ? line.progress() : silent);
  if (ranks->rank() > 0) return report ? kExitDone : exit_code_of(report.error());
  if (!report) return tl::unexpected(report.error());
  line.print({{"material", request.out.string()},
              {"model", request.model},
              {"ranks", ranks->size()},
              {"seconds", report->seconds},
              {"gpu_bytes", report->gpu_bytes},
              {"fetches", report->fetches}},
             fmt::format("wrote {}: {} in {:.1f} s, {:.1f} MB on the GPU, {} fetches a pixel",
                         request.out.string(),
                         request.model,
                         report->seconds,
                         static_cast<double>(report->gpu_bytes) / 1e6,
                         report->fetches));
  return kExitDone;
}

}  // namespace veneer::cli
