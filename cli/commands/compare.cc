// SPDX-License-Identifier: Apache-2.0
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <iterator>
#include <numbers>
#include <optional>

#include "base/exit_code.h"
#include "base/files.h"
#include "btf/evaluation.h"
#include "btf/held_out.h"
#include "cli/commands/commands.h"
#include "cli/comparison/tables.h"
#include "cli/picture_size.h"

namespace veneer::cli {
namespace {

// What is compared where nothing else is asked for: the paper's five in its order, then the others.
struct Entry {
  std::string model;
  std::string components;  // empty where the model has none
};
const std::array kEntries{Entry{"lafortune", ""},
                          Entry{"scaled-lafortune", ""},
                          Entry{"reflectance-field", ""},
                          Entry{"eigen-texture", "16"},
                          Entry{"lpca", "8"},
                          Entry{"phong", ""},
                          Entry{"revised-lpca", "8"},
                          Entry{"texel-colours", "3+1"},
                          Entry{"texel-colours", "6+2"},
                          Entry{"dichromatic-lpca", "4+4"},
                          Entry{"layered", ""}};

// That Table 4 is over, every pair of each; as many as `evaluate` compares as drawn.
constexpr int kHeldOutTexels = 1024;

struct CompareOptions {
  std::filesystem::path set;
  std::filesystem::path out;
  std::vector<std::string> models;     // empty: kEntries
  std::string material;                // empty: guessed from the set's name
  std::vector<int> tables;             // empty: all
  std::optional<double> held_out_deg;  // views beyond are held out for Table 4
  std::uint64_t seed = 1;
  render::RenderBenchOptions bench;
  std::string size = "1024x768";
};

/// What `--models` asks for: NAME takes that model's lines of the list above, NAME:COMPONENTS one
/// of its own.
Result<std::vector<Entry>> entries(const std::vector<std::string>& names, bool polarised) {
  std::vector<Entry> chosen;
  if (names.empty()) {
    std::ranges::copy_if(kEntries, std::back_inserter(chosen), [polarised](const Entry& entry) {
      const auto model = btf::find_model(entry.model);
      return polarised || (model && !(*model)->polarised);
    });
    return chosen;
  }
  for (const std::string& name : names) {
    const std::size_t colon = name.find(':');
    VENEER_ASSIGN(const btf::Model* model, btf::find_model(name.substr(0, colon)));
    if (model->polarised && !polarised)
      return fail(Errc::kInvalidOption,
                  "comparing {}: it fits only sets that know specular and diffuse light apart",
                  model->name);
    if (colon != std::string::npos) {
      chosen.push_back({std::string(model->name), name.substr(colon + 1)});
      continue;
    }
    const auto before = chosen.size();
    std::ranges::copy_if(kEntries, std::back_inserter(chosen), [model](const Entry& entry) {
      return entry.model == model->name;
    });
    if (chosen.size() == before)
      return fail(Errc::kInvalidOption,
                  "comparing {}: say with how many components, such as {}:4",
                  model->name,
                  model->name);
  }
  return chosen;
}

struct Fitted {
  std::shared_ptr<const btf::Material> material;
  double seconds = 0;
};

Result<Fitted> fit(const btf::SampleSet& set,
                   const Entry& entry,
                   std::uint64_t seed,
                   Progress& progress) {
  VENEER_ASSIGN(const btf::Model* model, btf::find_model(entry.model));
  if (model->terms == 0 && !entry.components.empty())
    return fail(Errc::kInvalidOption, "comparing {}: it has no components", entry.model);
  btf::FitOptions options;
  options.clusters = kPublishedClusters;
  options.lobes = kPublishedLobes;
  options.seed = seed;
  if (!entry.components.empty()) options.components = entry.components;
  const auto begin = std::chrono::steady_clock::now();
  VENEER_ASSIGN(std::unique_ptr<btf::Material> material, model->fit(set, options, progress));
  const auto end = std::chrono::steady_clock::now();
  return Fitted{std::move(material), std::chrono::duration<double>(end - begin).count()};
}

/// A set without some of its views, for as long as it is needed.
class NearSet {
 public:
  static Result<NearSet> of(const btf::SampleSet& set, double most_theta_rad) {
    std::error_code error;
    const std::filesystem::path temporary = std::filesystem::temp_directory_path(error);
    if (error)
      return fail(Errc::kIo,
                  "holding out views: no folder for temporary files: {}; set TMPDIR to one",
                  error.message());
    VENEER_ASSIGN(StagedFolder folder, StagedFolder::create(temporary / "veneer-compare"));
    VENEER_ASSIGN(btf::SampleSet near,
                  btf::without_views_beyond(set, most_theta_rad, folder.path() / "near.btfset"));
    return NearSet{std::move(folder), std::move(near)};
  }
  [[nodiscard]] const btf::SampleSet& set() const { return set_; }

 private:
  NearSet(StagedFolder folder, btf::SampleSet set)
      : folder_(std::move(folder)), set_(std::move(set)) {}
  StagedFolder folder_;  // never committed, so that nothing is left of it
  btf::SampleSet set_;
};

/// Times all materials in one run. A machine without GL leaves a remark in place of times.
Status time_drawing(const CompareOptions& options,
                    const std::vector<std::shared_ptr<const btf::Material>>& materials,
                    Comparison& comparison,
                    Progress& progress) {
  render::RenderBenchOptions bench = options.bench;
  for (std::size_t i = 0; i < materials.size(); ++i)
    bench.materials.push_back({comparison.models[i].name, materials[i]});
  const Result<render::RenderBenchResult> result = render::bench_render(bench, progress);
  if (!result) {
    if (result.error().code != Errc::kUnavailable) return tl::unexpected(result.error());
    comparison.no_timing = result.error().what;
    return {};
  }
  comparison.renderer = result->renderer;
  comparison.timing_clock = result->clock;
  comparison.timing_size = options.size;
  comparison.plain_ms = result->timings.front().ms_median;
  for (std::size_t i = 0; i < materials.size(); ++i)
    comparison.models[i].timing = result->timings[i + 1];
  return {};
}

Result<Comparison> compare(const CompareOptions& options, CommandLine& line) {
  VENEER_ASSIGN(const btf::SampleSet set, btf::SampleSet::open(options.set));
  VENEER_TRY(set.check_finite());
  const btf::SampleSetInfo& info = set.info();
  VENEER_ASSIGN(const std::vector<Entry> chosen, entries(options.models, info.polarised));
  const auto wanted = [&options](int table) {
    return options.tables.empty() ||
           std::ranges::find(options.tables, table) != options.tables.end();
  };
  Comparison comparison;
  // A trailing slash leaves an empty last name.
  comparison.set = (options.set / "").parent_path().stem().string();
  comparison.width = info.width;
  comparison.height = info.height;
  comparison.views = static_cast<int>(info.views.size());
  comparison.lights = static_cast<int>(info.lights.size());
  comparison.material = options.material.empty() ? guess_published_material(comparison.set)
                                                 : find_published_material(options.material);
  comparison.table1 = wanted(1);
  comparison.table2 = wanted(2);
  comparison.table3 = wanted(3);
  if (comparison.table1) comparison.mean_brdf = mean_brdf_errors(set);

  // Before minutes of fitting: it refuses an angle that does not divide the views.
  std::optional<NearSet> near;
  double most_theta_rad = 0.0;
  if (options.held_out_deg) {
    most_theta_rad = *options.held_out_deg * std::numbers::pi / 180.0;
    VENEER_ASSIGN(NearSet made, NearSet::of(set, most_theta_rad));
    near.emplace(std::move(made));
    comparison.most_theta_deg = options.held_out_deg;
  }

  std::vector<std::shared_ptr<const btf::Material>> materials;
  for (const Entry& entry : chosen) {
    ComparedModel& model = comparison.models.emplace_back();
    model.name = entry.model + (entry.components.empty() ? "" : " " + entry.components);
    model.published = find_published_model(entry.model, entry.components);
    line.note(fmt::format("{} of {}: {}", comparison.models.size(), chosen.size(), model.name));
    VENEER_ASSIGN(const Fitted fitted, fit(set, entry, options.seed, line.progress()));
    const std::shared_ptr<const btf::Material>& material = fitted.material;
    model.fit_seconds = fitted.seconds;
    if (comparison.table1) {
      VENEER_ASSIGN(const btf::Evaluation e, btf::evaluate(set, *material, line.progress()));
      model.errors = {e.encoded.epsilon_avg, e.encoded.texel_min, e.encoded.texel_max};
    }
    const btf::ModelShader shader = material->shader();
    model.values_per_texel = material->values_per_texel();
    model.bytes_per_texel = static_cast<double>(shader.gpu_bytes()) / info.texel_count();
    model.fetches = shader.fetches;
    if (comparison.table3) {
      const Result<ShaderCost> cost = shader_cost(shader.source);
      if (cost) {
        model.cost = *cost;
      } else if (cost.error().code == Errc::kUnavailable) {
        comparison.no_cost = cost.error().what;
      } else {
        return tl::unexpected(cost.error());
      }
    }
    if (near) {
      line.note(fmt::format("{} of {}: {}, without the views beyond {} degrees",
                            comparison.models.size(),
                            chosen.size(),
                            model.name,
                            *options.held_out_deg));
      VENEER_ASSIGN(const Fitted held_out, fit(near->set(), entry, options.seed, line.progress()));
      VENEER_ASSIGN(const btf::HeldOutErrors errors,
                    btf::held_out_errors(
                        set, *held_out.material, most_theta_rad, kHeldOutTexels, line.progress()));
      model.held_out = {held_out.seconds, errors};
    }
    materials.push_back(material);
  }
  if (comparison.table3) VENEER_TRY(time_drawing(options, materials, comparison, line.progress()));
  return comparison;
}

}  // namespace

Result<int> run_compare(CommandLine& line) {
  CompareOptions options;
  std::vector<std::string> names;
  for (const PublishedMaterial& material : published_materials()) names.emplace_back(material.name);
  names.emplace_back("none");
  CLI::App& app = line.app();
  app.add_option("set", options.set, "The sample set, NAME.btfset")->required();
  app.add_option("--tables",
                 options.tables,
                 "Which tables of Meseth et al. 2003, such as 1,2: 1 errors, 2 sizes, 3 cost of "
                 "drawing; all where none is named")
      ->delimiter(',')
      ->expected(0, 3)
      ->check(CLI::Range(1, 3));
  app.add_option("--held-out",
                 options.held_out_deg,
                 "Fit every model once more without the views beyond this many degrees from the "
                 "normal, such as 60, and say in Table 4 how far each is off there")
      ->check(CLI::Range(0.0, 90.0));
  app.add_option("--models",
                 options.models,
                 "Only these models: NAME or NAME:COMPONENTS, such as lpca,texel-colours:3+1")
      ->delimiter(',')
      ->allow_extra_args(false);
  app.add_option("--material",
                 options.material,
                 "The material of the paper whose figures are put beside; guessed from the set's "
                 "name where not given")
      ->check(CLI::IsMember(names));
  app.add_option("-o,--output", options.out, "Write the tables to this file, NAME.md");
  app.add_option("--size", options.size, "Pixels of the timed frames, WIDTHxHEIGHT")
      ->capture_default_str();
  app.add_option("--frames", options.bench.frames, "Timed draws of each model")
      ->capture_default_str();
  app.add_option("--seed", options.seed, "Seed of everything random")->capture_default_str();
  line.parse();
  std::erase(options.tables, 0);  // what CLI11 makes of --tables alone
  VENEER_ASSIGN(const PictureSize size, parse_size(options.size));
  options.bench.width = size.width;
  options.bench.height = size.height;
  VENEER_TRY(options.bench.check());  // before minutes of fitting

  VENEER_ASSIGN(const Comparison comparison, compare(options, line));
  const std::string text = to_markdown(comparison);
  if (options.out.empty()) {
    line.print(to_json(comparison), text);
  } else {
    VENEER_TRY(write_text(options.out, text));
    line.print(to_json(comparison), fmt::format("wrote {}", options.out.string()));
  }
  const std::vector<std::string> wrong = wrong_values(comparison);
  if (wrong.empty()) return kExitDone;
  line.note(fmt::format("not as many values a texel as Table 2 of the paper says: {}",
                        fmt::join(wrong, ", ")));
  return kExitGateMissed;
}

}  // namespace veneer::cli
