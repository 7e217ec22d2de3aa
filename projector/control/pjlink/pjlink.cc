// SPDX-License-Identifier: Apache-2.0
#include "projector/control/pjlink/pjlink.h"

#include <sys/eventfd.h>

#include <filesystem>
#include <fstream>
#include <utility>

namespace veneer::projector {

using pjlink::Reply;
using pjlink::Request;

namespace {

/// How often one that went on without answering is asked whether it did.
constexpr int kPowerQuestions = 5;

/// Not of a device or a pipe, and no longer than passwords are: the specification has 32.
Result<std::string> first_line_of(const std::filesystem::path& path) {
  constexpr std::size_t kLongest = 256;
  std::string text(kLongest + 1, '\0');
  std::error_code error;
  std::ifstream stream;
  if (std::filesystem::is_regular_file(path, error)) stream.open(path, std::ios::binary);
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(stream.gcount()));
  const std::size_t end = text.find_first_of("\r\n");
  const std::string line = text.substr(0, end);
  if (line.empty() || line.size() > kLongest)
    return fail(Errc::kNotFound,
                "opening the projector's control: the password cannot be read from {}; write it "
                "there as the first line, {} characters at most",
                path.string(),
                kLongest);
  return line;
}

}  // namespace

Result<PjlinkOptions> PjlinkOptions::read(TomlReader& config) {
  PjlinkOptions options;
  config.require("host", options.host);
  config.read("port", options.port);
  config.read("password", options.password);
  std::filesystem::path file;
  config.read("password_file", file);
  if (!file.empty()) {
    if (!options.password.empty())
      return fail(Errc::kInvalidOption,
                  "opening the projector's control: password and password_file are both set; keep "
                  "one");
    VENEER_ASSIGN(options.password, first_line_of(config.folder() / file));
  }
  double time_limit_s = to_seconds(options.time_limit);
  config.read("time_limit_s", time_limit_s);
  // Compared so that NaN is refused too.
  if (!(time_limit_s > 0 && time_limit_s <= 3600))
    return fail(Errc::kInvalidOption,
                "opening the projector's control: time_limit_s is {}; set it above 0, to 3600 at "
                "most",
                time_limit_s);
  options.time_limit = from_seconds(time_limit_s);
  return options;
}

Status PjlinkOptions::check() const {
  if (host.empty())
    return fail(Errc::kInvalidOption,
                "opening the projector's control: set host to the projector's name or address");
  if (port < 1 || port > 65535)
    return fail(Errc::kInvalidOption,
                "opening the projector's control: port is {}; set it from 1 to 65535 (4352 is the "
                "usual one)",
                port);
  return {};
}

Result<std::unique_ptr<Pjlink>> Pjlink::open(TomlReader& config, Clock& clock) {
  VENEER_ASSIGN(PjlinkOptions options, PjlinkOptions::read(config));
  VENEER_TRY(options.check());
  return std::make_unique<Pjlink>(std::move(options), clock);
}

Pjlink::Pjlink(PjlinkOptions options, Clock& clock)
    : options_(std::move(options)), clock_(clock), stop_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  VENEER_CHECK(bool(stop_));
}

void Pjlink::interrupt() { ::eventfd_write(stop_.value(), 1); }

std::string Pjlink::description() const {
  return fmt::format("PJLink projector at {}", options_.host);
}

Status Pjlink::connect() {
  const Time deadline = SteadyClock{}.now() + options_.time_limit;
  VENEER_ASSIGN(pjlink::Connection made,
                pjlink::Connection::open(
                    options_.host, options_.port, deadline, stop_.value(), options_.resolve));
  VENEER_ASSIGN(const std::string line, made.read_line(deadline));
  VENEER_ASSIGN(const pjlink::Greeting greeting, pjlink::read_greeting(line));
  digest_.clear();
  if (greeting.seed) {
    if (options_.password.empty())
      return fail(Errc::kInvalidOption,
                  "{}: it wants a password; set `password` or `password_file`, or clear it in the "
                  "projector's network menu",
                  description());
    digest_ = pjlink::digest(*greeting.seed, options_.password);
  }
  connection_ = std::move(made);
  fresh_ = true;
  last_used_ = clock_.now();
  return {};
}

Result<Reply> Pjlink::exchange(const Request& request) {
  const Time deadline = SteadyClock{}.now() + options_.time_limit;
  VENEER_TRY(connection_->write(std::exchange(digest_, {}) + pjlink::line_of(request), deadline));
  VENEER_ASSIGN(const std::string line, connection_->read_line(deadline));
  VENEER_ASSIGN(Reply reply, pjlink::read_reply(line, request));
  fresh_ = false;
  last_used_ = clock_.now();
  return reply;
}

Result<Reply> Pjlink::ask(const Request& request) {
  // What comes unasked is its end, or belongs to a request of before.
  if (connection_ && (clock_.now() - last_used_ > options_.longest_idle || connection_->has_news()))
    connection_.reset();
  while (true) {
    if (!connection_) VENEER_TRY(connect());
    const bool may_be_stale = !fresh_;
    Result<Reply> reply = exchange(request);
    if (reply) return reply;
    connection_.reset();
    if (reply.error().code != Errc::kDisconnected || !may_be_stale) return reply;
  }
}

Result<std::optional<std::string>> Pjlink::ask_if_known(const Request& request,
                                                        ProjectorState& state) {
  VENEER_ASSIGN(Reply reply, ask(request));
  if (reply.refusal == 0) return std::optional(std::move(reply.parameter));
  constexpr int kFailed = 4;
  if (reply.refusal == kFailed) state.health["other"] = Health::kError;
  return std::optional<std::string>();
}

Result<Reply> Pjlink::try_command(const Request& request) {
  state_.reset();  // what was known is no longer true, whatever becomes of this
  VENEER_ASSIGN(Reply reply, ask(request));
  if (reply.refusal != 0 || reply.parameter == "OK") return reply;
  connection_.reset();
  return fail(Errc::kBadFormat,
              "{}: it answers \"{}\" to a command; try again",
              description(),
              pjlink::readable(reply.parameter));
}

Status Pjlink::command(const Request& request) {
  VENEER_ASSIGN(const Reply reply, try_command(request));
  if (reply.refusal == 0) return {};
  return tl::unexpected<Error>(pjlink::error_of(reply, request));
}

Result<int> Pjlink::protocol_class() {
  if (class_) return *class_;
  const Result<Reply> reply = ask({1, "CLSS", "?"});
  if (!reply) return tl::unexpected<Error>(reply.error());
  class_ = reply->parameter == "2" ? 2 : 1;
  return *class_;
}

Result<ProjectorState> Pjlink::read_state() {
  if (state_ && clock_.now() - state_time_ < options_.shortest_period) return *state_;
  VENEER_ASSIGN(state_, ask_for_everything());
  state_time_ = clock_.now();
  return *state_;
}

Result<ProjectorState> Pjlink::ask_for_everything() {
  using Answer = std::optional<std::string>;
  ProjectorState state;
  VENEER_ASSIGN(const int highest, protocol_class());
  VENEER_ASSIGN(const Answer power, ask_if_known({1, "POWR", "?"}, state));
  if (power) {
    VENEER_ASSIGN(state.power, pjlink::read_power(*power));
  }
  VENEER_ASSIGN(const Answer input, ask_if_known({highest, "INPT", "?"}, state));
  if (input) {
    VENEER_ASSIGN(state.input, pjlink::input_name(*input));
  }
  VENEER_ASSIGN(const Answer mute, ask_if_known({1, "AVMT", "?"}, state));
  if (mute) {
    VENEER_ASSIGN(state.muted, pjlink::read_mute(*mute));
  }
  VENEER_ASSIGN(const Answer health, ask_if_known({1, "ERST", "?"}, state));
  if (health) {
    VENEER_ASSIGN(auto told, pjlink::read_health(*health));
    if (state.health.contains("other")) told["other"] = Health::kError;
    state.health = std::move(told);
  }
  VENEER_ASSIGN(const Answer lamps, ask_if_known({1, "LAMP", "?"}, state));
  if (lamps) {
    VENEER_ASSIGN(state.lamps, pjlink::read_lamps(*lamps));
  }
  const auto read_text = [&](int protocol_class, const char* letters, auto& text) -> Status {
    VENEER_ASSIGN(const Answer answer, ask_if_known({protocol_class, letters, "?"}, state));
    if (answer && !answer->empty()) text = pjlink::readable(*answer);
    return {};
  };
  VENEER_TRY(read_text(1, "INF1", state.maker));
  VENEER_TRY(read_text(1, "INF2", state.model));
  VENEER_TRY(read_text(1, "NAME", state.name));
  if (highest < 2) return state;
  VENEER_ASSIGN(const Answer frozen, ask_if_known({2, "FREZ", "?"}, state));
  if (frozen) {
    VENEER_ASSIGN(state.frozen, pjlink::read_flag(*frozen));
  }
  VENEER_ASSIGN(const Answer incoming, ask_if_known({2, "IRES", "?"}, state));
  if (incoming) state.input_resolution = pjlink::read_resolution(*incoming);
  if (state.input_resolution) state.locked = true;
  if (incoming == pjlink::kNoSignal && state.power == Power::kOn) state.locked = false;
  VENEER_ASSIGN(const Answer panel, ask_if_known({2, "RRES", "?"}, state));
  if (panel) state.panel_resolution = pjlink::read_resolution(*panel);
  if (input) {
    VENEER_ASSIGN(const Answer label, ask_if_known({2, "INNM", "?" + *input}, state));
    if (label && !label->empty()) state.input_label = pjlink::readable(*label);
  }
  VENEER_TRY(read_text(2, "SNUM", state.serial));
  VENEER_TRY(read_text(2, "SVER", state.firmware));
  return state;
}

Status Pjlink::power(bool on) {
  Status done = command({1, "POWR", on ? "1" : "0"});
  if (done || !on) return done;
  // Some go on from standby without a word.
  const Errc code = done.error().code;
  if (code != Errc::kTimeout && code != Errc::kDisconnected) return done;
  return went_on_anyway(done.error());
}

Status Pjlink::went_on_anyway(const Error& silence) {
  for (int i = 0; i < kPowerQuestions; ++i) {
    clock_.sleep_until(clock_.now() + options_.shortest_period);
    const Result<Reply> reply = ask({1, "POWR", "?"});
    if (!reply || reply->refusal != 0) continue;
    VENEER_ASSIGN(const Power power, pjlink::read_power(reply->parameter));
    if (power == Power::kOn || power == Power::kWarmUp) return {};
  }
  return fail(silence.code,
              "switching on the {}: it did not answer and is not seen to go on; wait a minute and "
              "ask for its status, and set its standby mode to \"network\" or \"normal\"",
              description());
}

Status Pjlink::mute(bool on) {
  // The picture alone; those that only know picture and sound together refuse the value.
  VENEER_ASSIGN(const Reply reply, try_command({1, "AVMT", on ? "11" : "10"}));
  constexpr int kBadParameter = 2;
  if (reply.refusal == kBadParameter) return command({1, "AVMT", on ? "31" : "30"});
  if (reply.refusal == 0) return {};
  return tl::unexpected<Error>(pjlink::error_of(reply, {1, "AVMT", on ? "11" : "10"}));
}

Status Pjlink::freeze(bool on) {
  VENEER_ASSIGN(const int highest, protocol_class());
  if (highest < 2)
    return fail(Errc::kUnavailable,
                "{}: it speaks PJLink of class 1, which has no freeze; use its remote control",
                description());
  return command({2, "FREZ", on ? "1" : "0"});
}

Status Pjlink::select_input(const std::string& input) {
  VENEER_ASSIGN(const std::string code, pjlink::input_code(input));
  VENEER_ASSIGN(const int highest, protocol_class());
  return command({highest, "INPT", code});
}

}  // namespace veneer::projector
