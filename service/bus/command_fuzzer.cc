// SPDX-License-Identifier: Apache-2.0
#include <climits>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

#include "base/testing/fuzzing.h"
#include "base/testing/law.h"
#include "service/bus/command.h"

namespace veneer::service {
namespace {

/// A daemon that is not to be troubled with nonsense.
class StrictControl final : public ServiceControl {
 public:
  explicit StrictControl(std::string_view text) : text_(text) {}
  [[nodiscard]] int calls() const { return calls_; }

  [[nodiscard]] ServiceStatus status() const override { return {}; }
  [[nodiscard]] std::uint64_t frames() const override { return 0; }
  [[nodiscard]] std::uint64_t turns() const override { return 0; }
  [[nodiscard]] Status load_material(const std::filesystem::path& path) override {
    return take_path(path);
  }
  [[nodiscard]] Status set_scene(const std::filesystem::path& path) override {
    return take_path(path);
  }
  [[nodiscard]] Status set_light(int index, const LightSetting& light) override {
    law(index >= 0 && light.check().has_value(), "a light that is none came through");
    return answer();
  }
  [[nodiscard]] Status blank(bool) override { return answer(); }
  [[nodiscard]] Status reload() override { return answer(); }
  [[nodiscard]] Result<std::filesystem::path> snapshot() override {
    VENEER_TRY(answer());
    return std::filesystem::path(text_);
  }

 private:
  Status take_path(const std::filesystem::path& path) {
    law(path.is_absolute() && path.native().size() < PATH_MAX, "a path that is none came through");
    law(path.native().find('\0') == std::string::npos, "a path with an end within came through");
    return answer();
  }
  Status answer() {
    ++calls_;
    // Refuses half of all, with a text as wild as the input.
    if (text_.size() % 2 == 1)
      return tl::unexpected(
          Error{static_cast<Errc>(text_.size() % 8), std::string(text_.substr(0, 1000))});
    return {};
  }
  std::string_view text_;
  int calls_ = 0;
};

/// A value of as many bytes as there are, the rest zero.
template <class T>
T take(std::string_view& bytes) {
  T value{};
  const std::size_t count = std::min(sizeof(T), bytes.size());
  std::memcpy(&value, bytes.data(), count);
  bytes.remove_prefix(count);
  return value;
}

Command command_of(std::string_view bytes) {
  const auto kind = take<std::uint8_t>(bytes) % std::variant_size_v<Command>;
  if (kind == 0) return LoadMaterial{std::string(bytes)};
  if (kind == 1) return SetScene{std::string(bytes)};
  if (kind == 2) {
    SetLight command;
    command.index = take<int>(bytes);
    command.light.illuminance_lux = take<double>(bytes);
    for (int i = 0; i < 3; ++i) command.light.direction_to_light[i] = take<double>(bytes);
    for (int i = 0; i < 3; ++i) command.light.colour[i] = take<double>(bytes);
    return command;
  }
  if (kind == 3) return Blank{(take<std::uint8_t>(bytes) & 1) != 0};
  if (kind == 4) return Reload{};
  return Snapshot{};
}

/// The first byte says which method, the rest is what it is called with and what the daemon says.
Verdict read(std::string_view bytes) {
  const Command command = command_of(bytes);
  StrictControl control(bytes);
  const Status checked = check(command);
  const Result<std::string> done = carry_out(command, control);
  law(control.calls() == (checked ? 1 : 0), "the daemon is asked once, and not for nonsense");
  if (!checked) {
    law(checked.error().code == Errc::kInvalidOption && !checked.error().what.empty(),
        "a refusal without a reason");
    law(checked.error().what == readable(checked.error().what), "a refusal that cannot be sent");
    law(checked.error().what.size() < 4096, "a refusal as long as what it refuses");
  }
  if (!done) law(errc_of(error_name_of(done.error().code)) == done.error().code, "a code is lost");
  const std::string text = text_of(command);
  law(text == readable(text) && text.size() < 4096, "a text that cannot be logged");
  const std::string clean = readable(bytes);
  law(clean.size() == bytes.size() && readable(clean) == clean, "a text does not stay readable");
  if (!checked) return refused(checked.error());
  return accepted();
}

/// SetLight, of the first lamp.
std::string light(double lux) {
  std::string bytes("\2\0\0\0\0", 5);
  for (const double value : {lux, 0.3, 0.5, 0.8, 1.0, 0.9, 0.8})
    bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
  return bytes;
}

}  // namespace
}  // namespace veneer::service

const veneer::FuzzedReader& veneer::fuzzed_reader() {
  using namespace service;
  using namespace std::string_literals;
  static const FuzzedReader kReader{&read,
                                    {"\0/m/a.safetensors"s,
                                     "\1/m/scene.toml"s,
                                     "\1/"s + std::string(4000, 'a'),
                                     light(300),
                                     "\3\1"s,
                                     "\4"s,
                                     "\5"s},
                                    {1024, 8},
                                    {light(-1), "\1relative"s}};
  return kReader;
}
