// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include <chrono>
#include <numbers>
#include <optional>
#include <vector>

#include "base/exit_code.h"
#include "base/files.h"
#include "btf/fixed_directions.h"
#include "btf/material.h"
#include "cli/commands/commands.h"
#include "cli/ranks/ranks.h"

namespace veneer::cli {
namespace {

struct FitRequest {
  std::filesystem::path set;
  std::filesystem::path out;
  std::string model;
  std::vector<double> fixed_view;   // theta and phi in degrees, or none
  std::vector<double> fixed_light;  // theta and phi in degrees, or none
  btf::FitOptions options;

  [[nodiscard]] bool is_fixed() const { return !fixed_view.empty() || !fixed_light.empty(); }
};

struct FitReport {
  double seconds = 0.0;
  std::size_t gpu_bytes = 0;
  int fetches = 0;
};

std::optional<btf::Direction> direction_of(const std::vector<double>& degrees) {
  if (degrees.empty()) return std::nullopt;
  constexpr double kDegree = std::numbers::pi / 180.0;
  return btf::direction_from_angles({degrees[0] * kDegree, degrees[1] * kDegree});
}

// The set that is fitted, and the folder that holds it for as long where it had to be made.
struct FittedSet {
  std::optional<StagedFolder> folder;
  btf::SampleSet set;
};

Result<FittedSet> open_set(const FitRequest& request, Progress& progress) {
  VENEER_ASSIGN(btf::SampleSet set, btf::SampleSet::open(request.set));
  if (!request.is_fixed()) return FittedSet{std::nullopt, std::move(set)};
  // Beside the material, where there is room and a leftover of a dead process is found.
  VENEER_ASSIGN(StagedFolder folder, StagedFolder::create(request.out.string() + ".btfset"));
  VENEER_ASSIGN(
      btf::SampleSet fixed,
      btf::fix_directions(set,
                          {direction_of(request.fixed_view), direction_of(request.fixed_light)},
                          folder.path() / "fixed.btfset",
                          progress));
  return FittedSet{std::move(folder), std::move(fixed)};
}

// What every rank does; rank 0 writes the material.
Result<FitReport> fit(const FitRequest& request, btf::Communicator& ranks, Progress& progress) {
  VENEER_ASSIGN(const btf::Model* model, btf::find_model(request.model));
  if (ranks.size() > 1 && !model->over_ranks)
    return fail(
        Errc::kInvalidOption,
        "fit: {} is not shared among processes, of which there are {}; run it without mpirun",
        request.model,
        ranks.size());
  if (ranks.size() > 1 && request.is_fixed())
    return fail(Errc::kInvalidOption,
                "fit: a fixed view or light is not shared among processes, of which there are {}; "
                "run it without mpirun",
                ranks.size());
  const Result<FittedSet> opened = open_set(request, progress);
  VENEER_TRY(btf::agree(ranks, opened ? Status() : tl::unexpected(opened.error())));
  const btf::SampleSet& set = opened->set;
  const auto begin = std::chrono::steady_clock::now();
  VENEER_ASSIGN(const std::unique_ptr<btf::Material> material,
                model->fit(set, request.options, progress));
  FitReport report;
  report.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  Status saved;
  if (ranks.rank() == 0) {
    saved = btf::save_material(*material,
                               request.out,
                               {{"fitted_on", set.info().source},
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
  std::vector<double> heights;
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
  app.add_option("--layers",
                 options.layers,
                 "Layers of layered; 0: as many as the sample's parallax supports")
      ->capture_default_str();
  app.add_option(
         "--heights",
         heights,
         "Where the lowest and the highest of them lie, texels above the reference plane, as "
         "--heights=-1,3; found from the sample where nobody says")
      ->delimiter(',')
      ->expected(2);
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
  app.add_option("--mip-levels",
                 options.mip_levels,
                 "The sample and halvings of it, for when several texels fall on a pixel; "
                 "texel-colours")
      ->capture_default_str();
  app.add_option("--iterations", options.iterations, "Rounds of clustering at most")
      ->capture_default_str();
  app.add_option("--fixed-view",
                 request.fixed_view,
                 "theta,phi in degrees: fit for this view alone, which drops two dimensions")
      ->delimiter(',')
      ->expected(2);
  app.add_option("--fixed-light",
                 request.fixed_light,
                 "theta,phi in degrees: fit for a light from there alone")
      ->delimiter(',')
      ->expected(2);
  app.add_option("--seed", options.seed, "Seed of everything random")->capture_default_str();
  line.parse();
  if (!heights.empty()) options.heights = btf::HeightRange{heights[0], heights[1]};

  VENEER_ASSIGN(const std::unique_ptr<btf::Communicator> ranks, connect_ranks());
  options.ranks = ranks.get();
  SilentProgress silent;
  const Result<FitReport> report =
      fit(request, *ranks, ranks->rank() == 0 ? line.progress() : silent);
  const Status agreed = btf::agree(*ranks, report ? Status() : tl::unexpected(report.error()));
  // Rank 0 tells, and fails, for all: another that ended first would have mpirun cut it short.
  if (ranks->rank() > 0) return kExitDone;
  VENEER_TRY(agreed);
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
