// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <utility>

#include "base/files.h"
#include "btf/internal_sample_set.h"

namespace veneer::btf {
namespace {

// How many bytes the UTF-8 character at the beginning takes, 0 where none begins there (Unicode
// 15.0, table 3-7: neither longer than needed, nor a surrogate, nor beyond U+10FFFF).
std::size_t utf8_length(std::string_view text) {
  const auto byte = [text](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char first = byte(0);
  if (first < 0x80) return 1;
  const std::size_t length = first < 0xc2   ? 0
                             : first < 0xe0 ? 2
                             : first < 0xf0 ? 3
                             : first < 0xf5 ? 4
                                            : 0;
  if (length == 0 || length > text.size()) return 0;
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xc0) != 0x80) return 0;
  }
  const unsigned char second = byte(1);
  const bool too_long = (first == 0xe0 && second < 0xa0) || (first == 0xf0 && second < 0x90);
  const bool outside = (first == 0xed && second > 0x9f) || (first == 0xf4 && second > 0x8f);
  return too_long || outside ? 0 : length;
}

// A TOML basic string. Bytes that are no UTF-8, as in file names of old archives, become the
// replacement character.
std::string toml_string(std::string_view text) {
  std::string result = "\"";
  while (!text.empty()) {
    const std::size_t length = utf8_length(text);
    const char c = text.front();
    if (length == 0) {
      result += "\xef\xbf\xbd";
    } else if (length > 1) {
      result += text.substr(0, length);
    } else if (c == '"' || c == '\\') {
      result += '\\';
      result += c;
    } else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      result += fmt::format("\\u{:04x}", static_cast<unsigned>(c));
    } else {
      result += c;
    }
    text.remove_prefix(std::max<std::size_t>(length, 1));
  }
  return result + '"';
}

// A TOML float that reads back the same.
std::string toml_number(double value) {
  std::string text = fmt::format("{}", value);
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  return text;
}

std::string set_toml(const SampleSetInfo& info) {
  std::vector<std::string> channels;
  for (const std::string& name : internal::channel_names(info.polarised))
    channels.push_back(toml_string(name));
  std::string text =
      "# A sample is pi * f_r * cos(theta_l): a white Lambertian texel lit along its normal is "
      "1.\n";
  text += "layout = \"product\"\n";
  text += fmt::format("width = {}\nheight = {}\n", info.width, info.height);
  text += fmt::format("texel_pitch_mm = {}\n", toml_number(info.texel_pitch_mm));
  text += fmt::format("channels = [{}]\n", fmt::join(channels, ", "));
  text += fmt::format("scale = {}\ncosine = \"included\"\n", toml_number(info.scale));
  text += fmt::format(
      "source = {}\nlicence = {}\n", toml_string(info.source), toml_string(info.licence));
  return text;
}

}  // namespace

struct SampleSetWriter::State {
  State(SampleSetInfo set_info, StagedFolder staged_folder, SafetensorsWriter writer)
      : info(std::move(set_info)), folder(std::move(staged_folder)), samples(std::move(writer)) {}
  SampleSetInfo info;
  StagedFolder folder;
  SafetensorsWriter samples;  // lies in the folder, so it goes first
  std::span<Eigen::half> values;
  std::atomic<std::int64_t> clamped = 0;
};

SampleSetWriter::SampleSetWriter(std::unique_ptr<State> state) : state_(std::move(state)) {}
SampleSetWriter::SampleSetWriter(SampleSetWriter&&) noexcept = default;
SampleSetWriter::~SampleSetWriter() = default;

Result<SampleSetWriter> SampleSetWriter::create(const std::filesystem::path& folder,
                                                const SampleSetInfo& info) {
  VENEER_TRY(internal::check_info(
      info, Errc::kInvalidOption, fmt::format("writing sample set {}", folder.string())));
  VENEER_ASSIGN(StagedFolder staged, StagedFolder::create(folder));
  VENEER_ASSIGN(SafetensorsWriter samples,
                SafetensorsWriter::create(
                    staged.path() / internal::kSamplesName,
                    {TensorSpec{internal::kTensorName, DType::kF16, internal::sample_shape(info)}},
                    {{"format", "veneer-sample-set"}}));
  auto state = std::make_unique<State>(info, std::move(staged), std::move(samples));
  state->values = state->samples.tensor<Eigen::half>(internal::kTensorName);
  return SampleSetWriter(std::move(state));
}

std::span<Eigen::half> SampleSetWriter::texel(int texel) {
  const SampleSetInfo& info = state_->info;
  VENEER_CHECK(texel >= 0 && texel < info.texel_count());
  const auto size =
      static_cast<std::size_t>(info.pair_count()) * static_cast<std::size_t>(info.channel_count());
  return state_->values.subspan(static_cast<std::size_t>(texel) * size, size);
}

Eigen::half SampleSetWriter::stored(float sample) {
  constexpr double kLargest = 65504.0;
  const double value = static_cast<double>(sample) / state_->info.scale;
  if (!(std::abs(value) > kLargest)) return Eigen::half(static_cast<float>(value));
  ++state_->clamped;
  return Eigen::half(static_cast<float>(std::copysign(kLargest, value)));
}

std::int64_t SampleSetWriter::clamped() const { return state_->clamped; }

std::string SampleSetWriter::clamped_remark() const {
  if (clamped() == 0) return {};
  return fmt::format("{} samples beyond what the set can hold were cut to that", clamped());
}

Status SampleSetWriter::finish() {
  const std::filesystem::path& folder = state_->folder.path();
  VENEER_TRY(write_text(folder / internal::kTomlName, set_toml(state_->info)));
  VENEER_TRY(write_directions(folder / internal::kViewsName, state_->info.views));
  VENEER_TRY(write_directions(folder / internal::kLightsName, state_->info.lights));
  VENEER_TRY(state_->samples.finish());
  return state_->folder.commit();
}

}  // namespace veneer::btf
