// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>

#include "cli/comparison/tables.h"

namespace veneer::cli {
namespace {

using Row = std::vector<std::string>;

// A Markdown table whose first column is left-aligned, the others right-aligned.
class Table {
 public:
  explicit Table(const Row& header) {
    add(header);
    text_ += "|---|";
    for (std::size_t i = 1; i < header.size(); ++i) text_ += "---:|";
    text_ += '\n';
  }
  void add(const Row& row) { text_ += fmt::format("| {} |\n", fmt::join(row, " | ")); }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  std::string text_;
};

const PublishedErrors* published_errors(const Comparison& comparison, const ComparedModel& model) {
  if (comparison.material == nullptr || model.published == nullptr) return nullptr;
  const auto index = static_cast<std::size_t>(model.published - published_models().data());
  return &comparison.material->errors[index];
}

std::string label_of(const ComparedModel& model) {
  return model.published == nullptr ? std::string() : std::string(model.published->label);
}

std::string title(int number, std::string_view text) {
  return fmt::format("\n### Table {}: {}\n\n", number, text);
}

template <class... Figures>
void append(Row& row, fmt::string_view format, Figures... figures) {
  (row.push_back(fmt::format(fmt::runtime(format), figures)), ...);
}

std::string order(const Comparison& comparison) {
  const std::vector<OrderClaim> claims = published_order(comparison);
  if (claims.empty()) return {};
  Table table({"published as worse", "published as better", "here", "holds"});
  for (const OrderClaim& claim : claims) {
    table.add({label_of(*claim.worse),
               label_of(*claim.better),
               fmt::format("{:.4f} to {:.4f}", claim.worse->errors->avg, claim.better->errors->avg),
               claim.holds ? "yes" : "**no**"});
  }
  const auto held = std::ranges::count_if(claims, &OrderClaim::holds);
  return fmt::format(
      "\nThe published order, the same on all six materials of the paper, {} here ({} of {} "
      "comparisons):\n\n{}",
      held == std::ssize(claims) ? "holds" : "does **not** hold throughout",
      held,
      claims.size(),
      table.text());
}

std::string table1(const Comparison& comparison) {
  Row header{"model", "published as", "avg", "min", "max"};
  if (comparison.material != nullptr)
    for (const char* what : {"avg", "min", "max"}) header.push_back(fmt::format("{}, paper", what));
  header.emplace_back("fit, s");
  Table table(header);
  for (const ComparedModel& model : comparison.models) {
    if (!model.errors) continue;
    Row row{model.name, label_of(model)};
    append(row, "{:.4f}", model.errors->avg, model.errors->min, model.errors->max);
    if (const PublishedErrors* paper = published_errors(comparison, model)) {
      append(row, "{:.4f}", paper->avg, paper->min, paper->max);
    } else if (comparison.material != nullptr) {
      row.insert(row.end(), 3, "");
    }
    row.push_back(fmt::format("{:.1f}", model.fit_seconds));
    table.add(row);
  }
  if (comparison.mean_brdf) {
    Row row{"the mean of all texels", ""};
    append(row,
           "{:.4f}",
           comparison.mean_brdf->avg,
           comparison.mean_brdf->min,
           comparison.mean_brdf->max);
    row.insert(row.end(), comparison.material == nullptr ? 1 : 4, "");
    table.add(row);
  }
  std::string text = title(1, "epsilon over texels");
  text +=
      "epsilon of a texel is the mean absolute difference over its pairs of directions and its "
      "channels, of samples cut to [0, 1] and raised to 1/2.2 (gamma-encoded values). It is of the "
      "factors alone at the measured directions; avg, min and max are over the texels.\n";
  if (comparison.material != nullptr) {
    text += fmt::format(
        "The paper's figures are of the raw measurement of its {}. Sets decoded from code-books "
        "are "
        "smoother, and the paper does not say how it encodes: compare the order, not the level.\n",
        comparison.material->name);
  }
  return text + "\n" + table.text() + order(comparison);
}

std::string table2(const Comparison& comparison) {
  const SetSize size{comparison.width * comparison.height, comparison.views, comparison.lights};
  Table table({"model",
               "published as",
               "values",
               "values, by the paper's formula",
               "values, paper",
               "bytes on the GPU",
               "bytes, paper"});
  for (const ComparedModel& model : comparison.models) {
    Row row{model.name, label_of(model), fmt::format("{:.1f}", model.values_per_texel)};
    if (model.published == nullptr) {
      row.insert(row.end(), 2, "");
    } else {
      append(row, "{:.1f}", model.published->values_of(size), model.published->values);
    }
    append(row, "{:.1f}", model.bytes_per_texel);
    row.push_back(model.published == nullptr ? "" : fmt::format("{:.1f}", model.published->bytes));
    table.add(row);
  }
  std::string text = title(2, "values and bytes per texel");
  text +=
      "The paper's figures are for 256 x 256 texels and 81 x 81 directions; its formula is "
      "evaluated for this set, over whose texels clusters share what they have in common. Bytes on "
      "the GPU are of all textures, padding and tables of directions included.\n\n" +
      table.text();
  const std::vector<std::string> wrong = wrong_values(comparison);
  text += wrong.empty() ? "\nEvery model of the paper keeps as many values as the paper's formula "
                          "says.\n"
                        : fmt::format("\n**Not as many values as the paper's formula says: {}.**\n",
                                      fmt::join(wrong, ", "));
  return text;
}

std::string arithmetic_of(const ComparedModel& model) {
  if (!model.cost) return "";
  return fmt::format("{}{}", model.cost->loops_left ? "over " : "", model.cost->arithmetic);
}

std::string table3(const Comparison& comparison) {
  Table table({"model",
               "published as",
               "fetches",
               "TEX, paper",
               "ALU",
               "ALU, paper",
               "ms",
               "times plain",
               "fps, paper"});
  for (const ComparedModel& model : comparison.models) {
    const PublishedModel* paper = model.published;
    const auto of_paper = [paper](auto member) {
      return paper == nullptr ? std::string() : fmt::format("{}", paper->*member);
    };
    table.add({model.name,
               label_of(model),
               fmt::format("{}", model.fetches),
               of_paper(&PublishedModel::fetches),
               arithmetic_of(model),
               of_paper(&PublishedModel::alu),
               model.timing ? fmt::format("{:.1f}", model.timing->ms_median) : "",
               model.timing ? fmt::format("{:.2f}", model.timing->ratio) : "",
               of_paper(&PublishedModel::fps)});
  }
  std::string text = title(3, "cost of drawing");
  text +=
      "Fetches and ALU are of one call of the model's shader for one light. ALU is an estimate: "
      "instructions that compute in the shader compiled to SPIR-V, with functions inlined and "
      "loops "
      "written out; a vector's count as one; moves, fetches and branches do not count. The paper "
      "counts the fragment operations of its own programs, whose vertex programs compute the local "
      "directions.";
  text +=
      comparison.no_cost.empty() ? "\n" : fmt::format(" Not counted: {}.\n", comparison.no_cost);
  text +=
      comparison.no_timing.empty()
          ? fmt::format(
                "Times are medians of whole frames of {} pixels, all models taking turns in "
                "one run, on {} ({}); a plain textured draw takes {:.1f} ms. The paper's fps are "
                "of a shirt on a GeForce FX 5900.\n",
                comparison.timing_size,
                comparison.renderer,
                comparison.timing_clock,
                comparison.plain_ms)
          : fmt::format("Not timed: {}.\n", comparison.no_timing);
  return text + "\n" + table.text();
}

std::string table4(const Comparison& comparison, double most_theta_deg) {
  Table table({"model",
               "published as",
               "epsilon beyond",
               "epsilon within",
               "linear rmse beyond",
               "linear rmse within",
               "fit, s"});
  btf::HeldOutErrors counts;  // of views and texels, the same for all models
  for (const ComparedModel& model : comparison.models) {
    if (!model.held_out) continue;
    counts = model.held_out->errors;
    const btf::ViewsError& beyond = counts.beyond;
    const btf::ViewsError& within = counts.within;
    Row row{model.name, label_of(model)};
    append(row, "{:.4f}", beyond.epsilon, within.epsilon, beyond.rmse, within.rmse);
    row.push_back(fmt::format("{:.1f}", model.held_out->fit_seconds));
    table.add(row);
  }
  return title(4, fmt::format("views beyond {} degrees, which no fit saw", most_theta_deg)) +
         fmt::format(
             "Every model is fitted once more, on the {} views up to {} degrees from the normal. "
             "Errors are of these (within) and of the {} views that the fit did not see (beyond), "
             "over {} texels and all lights, as the shader draws; epsilon as in Table 1, rmse in "
             "linear light, both of values cut to [0, 1].\n\n",
             counts.within.views,
             most_theta_deg,
             counts.beyond.views,
             counts.texels) +
         table.text();
}

}  // namespace

std::string to_markdown(const Comparison& comparison) {
  std::string text = fmt::format("## {}: {} x {} texels, {} x {} directions\n",
                                 comparison.set,
                                 comparison.width,
                                 comparison.height,
                                 comparison.views,
                                 comparison.lights);
  if (comparison.table1) text += table1(comparison);
  if (comparison.table2) text += table2(comparison);
  if (comparison.table3) text += table3(comparison);
  if (comparison.most_theta_deg) text += table4(comparison, *comparison.most_theta_deg);
  return text;
}

}  // namespace veneer::cli
