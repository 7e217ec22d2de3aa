// SPDX-License-Identifier: Apache-2.0
#include "capture/recording.h"

#include <zlib.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <ctime>
#include <map>
#include <optional>
#include <system_error>

#include "base/files.h"
#include "base/image_files.h"
#include "base/locked_lines.h"
#include "capture/internal_recording.h"

namespace veneer::capture {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr std::string_view kFormat = "veneer-capture-session";
constexpr int kVersion = 1;
constexpr const char* kJournal = "journal.jsonl";
constexpr const char* kSession = "session.json";
constexpr std::array kTargets{
    Target::kSample, Target::kWhite, Target::kMirror, Target::kMirrorBall};
constexpr std::array<std::string_view, 3> kMosaics{"none", "polar-mono", "polar-colour"};

std::string checksum_of(const std::string& bytes) {
  const uLong crc =
      crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()), static_cast<z_size_t>(bytes.size()));
  return fmt::format("crc32:{:08x}", crc);
}

std::string wall_clock_now() {
  const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  std::tm parts{};
  ::gmtime_r(&now, &parts);
  std::array<char, 32> text{};
  (void)std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%SZ", &parts);
  return text.data();
}

json json_of(const Shot& shot) {
  return {{"target", text_of(shot.target)},
          {"view", shot.view},
          {"light", shot.light},
          {"analyser", shot.analyser},
          {"exposure", shot.exposure},
          {"dark", shot.dark},
          {"repeat", shot.repeat}};
}

std::optional<Shot> shot_from(const json& object) {
  if (!object.is_object()) return std::nullopt;
  Shot shot;
  const json target = object.value("target", json());
  const auto found = std::ranges::find_if(
      kTargets, [&target](Target each) { return target == std::string(text_of(each)); });
  if (found == kTargets.end()) return std::nullopt;
  shot.target = *found;
  const std::array<std::pair<const char*, int*>, 4> numbers{{{"view", &shot.view},
                                                             {"light", &shot.light},
                                                             {"analyser", &shot.analyser},
                                                             {"exposure", &shot.exposure}}};
  for (const auto& [key, value] : numbers) {
    const json number = object.value(key, json());
    // The greatest is far beyond any plan's, and a name of it is still short.
    if (!number.is_number_unsigned() || number.get<std::uint64_t>() > 1000000) return std::nullopt;
    *value = number.get<int>();
  }
  const std::array<std::pair<const char*, bool*>, 2> flags{
      {{"dark", &shot.dark}, {"repeat", &shot.repeat}}};
  for (const auto& [key, value] : flags) {
    const json flag = object.value(key, json());
    if (!flag.is_boolean()) return std::nullopt;
    *value = flag.get<bool>();
  }
  return shot;
}

std::string name_of(const Shot& shot) {
  return fmt::format("{}/view-{:02}/light-{:02}/analyser-{}-exposure-{}{}{}.exr",
                     text_of(shot.target),
                     shot.view,
                     shot.light,
                     shot.analyser,
                     shot.exposure,
                     shot.dark ? "-dark" : "",
                     shot.repeat ? "-repeat" : "");
}

template <class Number>
bool parse(const ExrAttributes& attributes, const char* key, Number& value) {
  const auto found = attributes.find(key);
  if (found == attributes.end()) return false;
  const char* end = found->second.data() + found->second.size();
  const auto [stop, error] = std::from_chars(found->second.data(), end, value);
  return error == std::errc() && stop == end;
}

std::vector<ExrChannel> channels_of(const Image<Rgb32f>& counts) {
  const bool grey = std::ranges::all_of(counts.pixels(), [](const Rgb32f& pixel) {
    return pixel[0] == pixel[1] && pixel[0] == pixel[2];
  });
  std::vector<ExrChannel> channels;
  for (const char* name : grey ? std::vector{"Y"} : std::vector{"R", "G", "B"}) {
    const auto c = static_cast<Eigen::Index>(channels.size());
    ExrChannel channel{name, Image<float>(counts.width(), counts.height())};
    std::ranges::transform(counts.pixels(),
                           channel.pixels.pixels().begin(),
                           [c](const Rgb32f& pixel) { return pixel[c]; });
    channels.push_back(std::move(channel));
  }
  return channels;
}

/// Empty where the channels are none of ours.
Image<Rgb32f> counts_from(const std::vector<ExrChannel>& channels) {
  const auto named = [&channels](const char* name) -> const Image<float>* {
    const auto found = std::ranges::find(channels, name, &ExrChannel::name);
    return found == channels.end() ? nullptr : &found->pixels;
  };
  std::array<const Image<float>*, 3> rgb{named("R"), named("G"), named("B")};
  if (const Image<float>* grey = named("Y")) rgb = {grey, grey, grey};
  if (std::ranges::count(rgb, nullptr) > 0) return {};
  Image<Rgb32f> counts(rgb[0]->width(), rgb[0]->height());
  for (std::size_t i = 0; i < counts.pixels().size(); ++i)
    counts.pixels()[i] = {rgb[0]->pixels()[i], rgb[1]->pixels()[i], rgb[2]->pixels()[i]};
  return counts;
}

/// Identity of the session in a text. Errors: kBadFormat, kInvalidOption.
Result<json> parse_session(const std::string& text) {
  json session = json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (!session.is_object() || session.value("format", json()) != std::string(kFormat))
    return fail(Errc::kBadFormat, "session.json is damaged, or was not written by Veneer");
  const json version = session.value("version", json());
  if (version.is_number_integer() && version.get<double>() > kVersion)
    return fail(Errc::kBadFormat,
                "it was made by a newer Veneer (format {}, this one knows {}); use that one",
                version.dump(),
                kVersion);
  if (version != kVersion || !session.value("camera", json()).is_string())
    return fail(Errc::kBadFormat, "session.json is damaged");
  return session;
}

/// Something in the folder that no session that was just begun has there.
std::string stranger_in(const fs::path& folder) {
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename().string();
    if (name == kJournal || name.starts_with(std::string(".") + kSession)) continue;
    return name;
  }
  return {};
}

}  // namespace

Result<std::size_t> Journal::take(std::string_view text) {
  return take_lines(text, [this](std::string_view line) { return take_line(line); });
}

bool Journal::take_line(std::string_view text) {
  const json line = json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (!line.is_object()) return false;
  if (const json key = line.value("note", json()); key.is_string() && line.contains("value")) {
    notes[key.get<std::string>()] =
        line["value"].dump(-1, ' ', false, json::error_handler_t::replace);
    return true;
  }
  const std::optional<Shot> shot = shot_from(line.value("picture", json()));
  const json bytes = line.value("bytes", json());
  const json checksum = line.value("checksum", json());
  if (!shot || !bytes.is_number_unsigned() || !checksum.is_string()) return false;
  pictures[*shot] = {bytes.get<std::uint64_t>(), checksum.get<std::string>()};
  return true;
}

struct Recording::State {
  fs::path folder;
  std::string camera;
  CapturePlan plan;
  Journal journal;
  std::vector<std::string> warnings;
  std::optional<LockedLines> lines;  // not of one that is only read
};

Recording::Recording(std::unique_ptr<State> state) : state_(std::move(state)) {}
Recording::Recording(Recording&&) noexcept = default;
Recording::~Recording() = default;

Result<Recording> Recording::resume(const fs::path& folder,
                                    const CapturePlan& plan,
                                    const std::string& camera) {
  const std::string doing = fmt::format("opening the session {}", folder.string());
  VENEER_TRY(plan.check());
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) return fail(Errc::kIo, "{}: {}", doing, error.message());
  if (!fs::exists(folder / kSession, error)) {
    if (const std::string stranger = stranger_in(folder); !stranger.empty())
      return fail(
          Errc::kInvalidOption,
          "{}: the folder is no session, there is {} in it; name another one, or an empty one",
          doing,
          stranger);
  }
  auto lines = LockedLines::open(folder / kJournal);
  if (!lines && lines.error().code == Errc::kUnavailable)
    return fail(Errc::kUnavailable,
                "{}: another program is capturing into it; let that one finish, or name another "
                "session",
                doing);
  if (!lines) return fail_while(doing, lines.error());

  const json identity{{"format", kFormat},
                      {"version", kVersion},
                      {"camera", camera},
                      {"plan", veneer::capture::json_of(plan)}};
  if (fs::exists(folder / kSession, error)) {
    VENEER_ASSIGN(const std::string text, read_text(folder / kSession));
    const Result<json> there = parse_session(text);
    if (!there) return fail_while(doing, there.error());
    if (*there != identity)
      return fail(
          Errc::kInvalidOption,
          "{}: it was begun under other conditions ({}); go on under those, or name another "
          "session",
          doing,
          difference(*there, identity));
  } else if (fs::file_size(folder / kJournal, error) > 0) {
    return fail(Errc::kBadFormat,
                "{}: session.json is gone, and the pictures cannot be told without it; bring it "
                "back, or name another session",
                doing);
  } else {
    // What a text that is not UTF-8 says is not worth an exception.
    VENEER_TRY(write_text(folder / kSession,
                          identity.dump(2, ' ', false, json::error_handler_t::replace) + "\n"));
  }

  auto state = std::make_unique<State>();
  state->folder = folder;
  state->camera = camera;
  state->plan = plan;
  const Status taken = lines->take(
      [&state](std::string_view line) -> Result<bool> { return state->journal.take_line(line); });
  if (!taken) return fail_while(fmt::format("{}: {}", doing, kJournal), taken.error());
  state->lines = std::move(*lines);
  for (auto it = state->journal.pictures.begin(); it != state->journal.pictures.end();) {
    const fs::path path = folder / name_of(it->first);
    const std::uintmax_t size = fs::file_size(path, error);
    if (!error && size == it->second.bytes) {
      ++it;
      continue;
    }
    state->warnings.push_back(fmt::format(
        "{} is {}; it is taken again", path.string(), error ? "gone" : "not what was written"));
    it = state->journal.pictures.erase(it);
  }
  return Recording(std::move(state));
}

Result<Recording> Recording::open(const fs::path& folder) {
  const std::string doing = fmt::format("reading the session {}", folder.string());
  std::error_code error;
  if (!fs::exists(folder / kSession, error))
    return fail(Errc::kNotFound,
                "{}: there is no session (no session.json in it); name the folder that the capture "
                "was told",
                doing);
  VENEER_ASSIGN(const std::string text, read_text(folder / kSession));
  const Result<json> session = parse_session(text);
  if (!session) return fail_while(doing, session.error());
  auto plan = plan_from(session->value("plan", json()));
  if (!plan) return fail(Errc::kBadFormat, "{}: session.json: {}", doing, plan.error().what);
  auto state = std::make_unique<State>();
  state->folder = folder;
  state->camera = (*session)["camera"].get<std::string>();
  state->plan = std::move(*plan);
  if (!fs::exists(folder / kJournal, error))
    return fail(Errc::kBadFormat, "{}: {} is gone; it says what is finished", doing, kJournal);
  VENEER_ASSIGN(const std::string journal, read_text(folder / kJournal));
  if (const auto taken = state->journal.take(journal); !taken)
    return fail_while(fmt::format("{}: {}", doing, kJournal), taken.error());
  return Recording(std::move(state));
}

const CapturePlan& Recording::plan() const { return state_->plan; }
const fs::path& Recording::folder() const { return state_->folder; }
const std::string& Recording::camera() const { return state_->camera; }
const std::vector<std::string>& Recording::warnings() const { return state_->warnings; }

std::vector<Shot> Recording::shots() const {
  std::vector<Shot> shots;
  for (const auto& [shot, ignored] : state_->journal.pictures) shots.push_back(shot);
  return shots;
}

bool Recording::has(const Shot& shot) const { return state_->journal.pictures.contains(shot); }

fs::path Recording::path_of(const Shot& shot) const { return state_->folder / name_of(shot); }

Status Recording::add(const Picture& picture) {
  VENEER_CHECK(state_->lines.has_value());
  const Shot& shot = picture.shot;
  const std::vector<double>& angles = state_->plan.polarisation.analyser_rad;
  const auto analyser = static_cast<std::size_t>(shot.analyser);
  ExrAttributes attributes{
      {"veneer.target", std::string(text_of(shot.target))},
      {"veneer.view", fmt::format("{}", shot.view)},
      {"veneer.light", fmt::format("{}", shot.light)},
      {"veneer.analyser", fmt::format("{}", shot.analyser)},
      {"veneer.exposure", fmt::format("{}", shot.exposure)},
      {"veneer.dark", shot.dark ? "1" : "0"},
      {"veneer.repeat", shot.repeat ? "1" : "0"},
      {"veneer.exposure_s", fmt::format("{}", picture.exposure_s)},
      {"veneer.full_scale", fmt::format("{}", picture.full_scale)},
      {"veneer.frames", fmt::format("{}", picture.frames)},
      {"veneer.mosaic", std::string(kMosaics[static_cast<std::size_t>(picture.mosaic)])},
      {"veneer.time_ns", fmt::format("{}", picture.time.time_since_epoch().count())},
      {"veneer.written", wall_clock_now()},
      {"veneer.camera", state_->camera}};
  if (picture.mosaic == Mosaic::kNone && analyser < angles.size())
    attributes["veneer.analyser_rad"] = fmt::format("{}", angles[analyser]);
  const fs::path path = path_of(shot);
  VENEER_TRY(write_exr(path, channels_of(picture.counts), attributes));
  VENEER_ASSIGN(const std::string bytes, read_text(path));
  const FileMark mark{bytes.size(), checksum_of(bytes)};
  const json line{{"picture", json_of(shot)}, {"bytes", mark.bytes}, {"checksum", mark.checksum}};
  if (const Status appended = state_->lines->append(line.dump()); !appended) {
    std::error_code ignored;  // it makes room, and is taken again anyhow
    fs::remove(path, ignored);
    state_->journal.pictures.erase(shot);
    return appended;
  }
  state_->journal.pictures[shot] = mark;
  return {};
}

Result<Picture> Recording::picture(const Shot& shot) const {
  const fs::path path = path_of(shot);
  const auto found = state_->journal.pictures.find(shot);
  if (found == state_->journal.pictures.end())
    return fail(
        Errc::kNotFound, "reading {}: it was not taken; run the capture again", path.string());
  VENEER_ASSIGN(const std::string bytes, read_text(path));
  if (bytes.size() != found->second.bytes || checksum_of(bytes) != found->second.checksum)
    return fail(Errc::kBadFormat,
                "reading {}: it was changed or damaged since it was taken; delete it and run the "
                "capture again",
                path.string());
  VENEER_ASSIGN(const ExrPicture exr, read_exr_picture(path));
  Picture picture;
  picture.shot = shot;
  picture.counts = counts_from(exr.channels);
  Duration::rep time = 0;
  const auto mosaic = exr.attributes.find("veneer.mosaic");
  const auto known =
      mosaic == exr.attributes.end() ? kMosaics.end() : std::ranges::find(kMosaics, mosaic->second);
  if (picture.counts.empty() || known == kMosaics.end() ||
      !parse(exr.attributes, "veneer.full_scale", picture.full_scale) ||
      !parse(exr.attributes, "veneer.exposure_s", picture.exposure_s) ||
      !parse(exr.attributes, "veneer.frames", picture.frames) ||
      !parse(exr.attributes, "veneer.time_ns", time))
    return fail(Errc::kBadFormat, "reading {}: it is no picture of a session", path.string());
  picture.mosaic = static_cast<Mosaic>(known - kMosaics.begin());
  picture.time = Time{Duration{time}};
  return picture;
}

Status Recording::note(const std::string& key, const std::string& text) {
  VENEER_CHECK(state_->lines.has_value());
  json value = json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (value.is_discarded())
    return fail(Errc::kInvalidOption, "noting \"{}\": \"{}\" is no JSON", key, text);
  const json line{{"note", key}, {"value", value}};
  VENEER_TRY(state_->lines->append(line.dump(-1, ' ', false, json::error_handler_t::replace)));
  state_->journal.notes[key] = value.dump(-1, ' ', false, json::error_handler_t::replace);
  return {};
}

std::string Recording::noted(const std::string& key) const {
  const auto found = state_->journal.notes.find(key);
  return found == state_->journal.notes.end() ? std::string() : found->second;
}

}  // namespace veneer::capture
