// SPDX-License-Identifier: Apache-2.0
#include "capture/cameras/gphoto2/internal_link.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <string_view>
#include <thread>

#include "base/unique_handle.h"
#include "capture/cameras/internal_holders.h"

namespace veneer::capture {
namespace {

struct FreeList {
  void operator()(::CameraList* list) const { gp_list_unref(list); }
};
using List = std::unique_ptr<::CameraList, FreeList>;
struct FreePorts {
  void operator()(GPPortInfoList* list) const { gp_port_info_list_free(list); }
};
struct FreeAbilities {
  void operator()(CameraAbilitiesList* list) const { gp_abilities_list_free(list); }
};
struct FreeFile {
  void operator()(::CameraFile* file) const { gp_file_unref(file); }
};
struct FreeWidget {
  void operator()(CameraWidget* widget) const { gp_widget_unref(widget); }
};
using Widget = std::unique_ptr<CameraWidget, FreeWidget>;

/// Makes one by a function of the library that writes it through a pointer; null where it fails.
template <class Owner, class New>
Owner make(New make_new) {
  typename Owner::pointer made = nullptr;
  return Owner(make_new(&made) >= GP_OK ? made : nullptr);
}

std::string ending(std::string_view name) {
  const auto dot = name.rfind('.');
  std::string ending(dot == std::string_view::npos ? std::string_view() : name.substr(dot + 1));
  std::transform(ending.begin(), ending.end(), ending.begin(), [](unsigned char c) {
    return static_cast<char>(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c);
  });
  return ending;
}

bool is_encoded(std::string_view name) {
  constexpr std::array<std::string_view, 5> kEncoded{"jpg", "jpeg", "heic", "heif", "hif"};
  return std::find(kEncoded.begin(), kEncoded.end(), ending(name)) != kEncoded.end();
}

/// What a memory card holds beside pictures.
bool is_picture(std::string_view name) {
  constexpr std::array<std::string_view, 8> kOther{
      "mov", "mp4", "avi", "wav", "thm", "xmp", "txt", "mts"};
  return std::find(kOther.begin(), kOther.end(), ending(name)) == kOther.end();
}

/// The first that is not encoded.
auto raw_among(const std::vector<CameraFilePath>& files) {
  return std::find_if(
      files.begin(), files.end(), [](const CameraFilePath& one) { return !is_encoded(one.name); });
}

// How long the encoded picture of a pair may come after the RAW one, to be deleted with it.
constexpr Duration kPartnerWait = std::chrono::milliseconds(500);

bool is_link_lost(int code) {
  return code == GP_ERROR_IO || code == GP_ERROR_IO_READ || code == GP_ERROR_IO_WRITE ||
         code == GP_ERROR_IO_USB_FIND || code == GP_ERROR_IO_INIT || code == GP_ERROR_IO_UPDATE;
}

}  // namespace

std::filesystem::path usb_node(const std::string& port) {
  constexpr std::string_view kPrefix = "usb:";
  const auto comma = port.find(',');
  if (!port.starts_with(kPrefix) || comma == std::string::npos) return {};
  return std::filesystem::path("/dev/bus/usb") / port.substr(4, comma - 4) / port.substr(comma + 1);
}

std::string obstacle(const std::string& port) {
  const auto node = usb_node(port);
  if (node.empty()) return {};
  std::string text = text_of(holders_of(node));
  if (!text.empty()) return text;
  std::error_code unseen;
  if (std::filesystem::exists(node, unseen) && ::access(node.c_str(), R_OK | W_OK) != 0) {
    return fmt::format(
        "no permission to write to {}: plug it in again after installing libgphoto2-6, whose udev "
        "rules let whoever sits at the machine use cameras, or join the group plugdev",
        node.string());
  }
  return {};
}

Result<std::vector<GphotoAddress>> find_gphoto_cameras() {
  const std::unique_ptr<GPContext, UnrefContext> context(gp_context_new());
  const auto list = make<List>(gp_list_new);
  const int found = list ? gp_camera_autodetect(list.get(), context.get()) : GP_ERROR_NO_MEMORY;
  if (found < GP_OK) {
    return fail(Errc::kIo, "looking for cameras with libgphoto2: {}", gp_result_as_string(found));
  }
  std::vector<GphotoAddress> cameras;
  for (int i = 0; i < found; ++i) {
    const char* model = nullptr;
    const char* port = nullptr;
    if (gp_list_get_name(list.get(), i, &model) < GP_OK ||
        gp_list_get_value(list.get(), i, &port) < GP_OK) {
      continue;
    }
    cameras.push_back({model, port});
  }
  return cameras;
}

GphotoLink::GphotoLink() : context_(gp_context_new()) {
  gp_context_set_error_func(
      context_.get(),
      [](GPContext*, const char* text, void* said) { *static_cast<std::string*>(said) = text; },
      &said_);
}

GphotoLink::~GphotoLink() {
  // Over a network, libgphoto2 2.5.30 also closes a third socket that it never opened, whose number
  // is 0: this program's standard input, or what has taken its number since.
  const bool network = address_.port.starts_with("ptpip:");
  const UniqueFd input(network ? ::fcntl(0, F_DUPFD_CLOEXEC, 3) : -1);
  if (camera_) gp_camera_exit(camera_.get(), context_.get());
  camera_.reset();
  if (input && ::fcntl(0, F_GETFD) == -1) ::dup2(input.value(), 0);
}

Result<std::unique_ptr<GphotoLink>> GphotoLink::open(const GphotoAddress& address) {
  std::unique_ptr<GphotoLink> link(new GphotoLink);
  link->address_ = address;
  const std::string doing = fmt::format("opening camera {} at {}", address.model, address.port);
  link->camera_ = make<std::unique_ptr<::Camera, FreeCamera>>(gp_camera_new);
  const auto ports = make<std::unique_ptr<GPPortInfoList, FreePorts>>(gp_port_info_list_new);
  const auto models =
      make<std::unique_ptr<CameraAbilitiesList, FreeAbilities>>(gp_abilities_list_new);
  if (!link->camera_ || !ports || !models) return fail(Errc::kIo, "{}: no memory", doing);

  int code = gp_port_info_list_load(ports.get());
  if (code < GP_OK) return link->failed(doing, code);
  code = gp_abilities_list_load(models.get(), link->context_.get());
  if (code < GP_OK) return link->failed(doing, code);
  const int port = gp_port_info_list_lookup_path(ports.get(), address.port.c_str());
  if (port < GP_OK) {
    return fail(Errc::kNotFound,
                "{}: there is no such port; `gphoto2 --auto-detect` lists cameras and `gphoto2 "
                "--list-ports` ports",
                doing);
  }
  const int model = gp_abilities_list_lookup_model(models.get(), address.model.c_str());
  if (model < GP_OK) {
    return fail(Errc::kNotFound,
                "{}: libgphoto2 knows no such model; `gphoto2 --list-cameras` lists them",
                doing);
  }
  GPPortInfo port_info{};
  CameraAbilities abilities{};
  gp_port_info_list_get_info(ports.get(), port, &port_info);
  gp_abilities_list_get_abilities(models.get(), model, &abilities);
  gp_camera_set_port_info(link->camera_.get(), port_info);
  gp_camera_set_abilities(link->camera_.get(), abilities);
  code = gp_camera_init(link->camera_.get(), link->context_.get());
  if (code < GP_OK) {
    std::string why = obstacle(address.port);
    if (why.empty() && code == GP_ERROR_IO_USB_CLAIM) why = text_of(camera_grabbers());
    if (!why.empty() || code == GP_ERROR_IO_USB_CLAIM || code == GP_ERROR_IO_LOCK) {
      return fail(Errc::kUnavailable,
                  "{}: {} ({}); end that program (GNOME's: `systemctl --user mask --now "
                  "gvfs-gphoto2-volume-monitor` and `pkill gvfsd-gphoto2`) and try again",
                  doing,
                  why.empty() ? "another program holds it" : why,
                  gp_result_as_string(code));
    }
    if (code == GP_ERROR_IO_USB_FIND || code == GP_ERROR_MODEL_NOT_FOUND) {
      return fail(Errc::kNotFound, "{}: it is not there; is it on, and awake?", doing);
    }
    return fail(Errc::kUnavailable,
                "{}: {}{}{}; is it on, awake, and connected to no other program or phone?",
                doing,
                gp_result_as_string(code),
                link->said_.empty() ? "" : ": ",
                link->said_);
  }
  if (auto serial = link->choice({"serialnumber", "eosserialnumber"})) link->serial_ = serial->now;
  return link;
}

bool GphotoLink::answers() {
  // Over a network the end of the connection looks like any refusal. This is asked of the camera
  // itself each time, and a camera that has no answer to it says so.
  CameraStorageInformation* storages = nullptr;
  int count = 0;
  const int code = gp_camera_get_storageinfo(camera_.get(), &storages, &count, context_.get());
  std::free(storages);
  said_.clear();
  return code >= GP_OK || code == GP_ERROR_NOT_SUPPORTED || code == GP_ERROR_CAMERA_BUSY;
}

tl::unexpected<Error> GphotoLink::failed(const std::string& doing, int code) {
  const std::string why =
      fmt::format("{}{}{}", gp_result_as_string(code), said_.empty() ? "" : ": ", said_);
  said_.clear();
  if (is_link_lost(code) || (code == GP_ERROR && !answers())) {
    return fail(Errc::kDisconnected,
                "{}: the camera at {} is gone ({}); check cable, battery and its automatic power "
                "off, then open it again",
                doing,
                address_.port,
                why);
  }
  if (code == GP_ERROR_CAMERA_BUSY) {
    return fail(Errc::kTimeout, "{}: the camera is busy and stays so ({}); try again", doing, why);
  }
  if (code == GP_ERROR_TIMEOUT) {
    return fail(Errc::kTimeout, "{}: no answer in time ({}); try again", doing, why);
  }
  if (code == GP_ERROR_NO_SPACE) {
    return fail(
        Errc::kIo, "{}: the card is full; empty it, or set the camera to keep nothing", doing);
  }
  return fail(Errc::kIo, "{}: the camera refuses ({})", doing, why);
}

template <class Call>
int GphotoLink::patiently(Call call) {
  // A camera that writes to its card is busy for a second or two.
  constexpr int kTries = 8;
  constexpr auto kPause = std::chrono::milliseconds(250);
  int code = call();
  for (int tried = 1; tried < kTries && code == GP_ERROR_CAMERA_BUSY; ++tried) {
    std::this_thread::sleep_for(kPause);
    code = call();
  }
  return code;
}

Result<CameraChoice> GphotoLink::choice(const std::vector<std::string>& names) {
  for (const std::string& name : names) {
    CameraWidget* read = nullptr;
    const int code = patiently([&] {
      return gp_camera_get_single_config(camera_.get(), name.c_str(), &read, context_.get());
    });
    if (is_link_lost(code)) return failed("reading setting " + name, code);
    if (code < GP_OK) continue;
    const Widget widget(read);
    CameraWidgetType type{};
    const char* now = nullptr;
    gp_widget_get_type(read, &type);
    if (type != GP_WIDGET_RADIO && type != GP_WIDGET_MENU && type != GP_WIDGET_TEXT) continue;
    if (gp_widget_get_value(read, &now) < GP_OK || now == nullptr) continue;
    CameraChoice choice{name, now, {}};
    for (int i = 0; type != GP_WIDGET_TEXT && i < gp_widget_count_choices(read); ++i) {
      const char* value = nullptr;
      if (gp_widget_get_choice(read, i, &value) >= GP_OK) choice.values.emplace_back(value);
    }
    said_.clear();
    return choice;
  }
  said_.clear();
  return fail(Errc::kUnavailable, "the camera has no setting \"{}\"", fmt::join(names, "\" or \""));
}

Status GphotoLink::set(const CameraChoice& choice, const std::string& value) {
  const std::string doing = fmt::format("setting {} to {}", choice.name, value);
  if (std::find(choice.values.begin(), choice.values.end(), value) == choice.values.end()) {
    return fail(
        Errc::kInvalidOption, "{}: the camera has only: {}", doing, fmt::join(choice.values, ", "));
  }
  const int code = patiently([&] {
    CameraWidget* read = nullptr;
    const int found =
        gp_camera_get_single_config(camera_.get(), choice.name.c_str(), &read, context_.get());
    if (found < GP_OK) return found;
    const Widget widget(read);
    gp_widget_set_value(read, value.c_str());
    return gp_camera_set_single_config(camera_.get(), choice.name.c_str(), read, context_.get());
  });
  if (code < GP_OK) return failed(doing, code);
  VENEER_ASSIGN(const CameraChoice after, this->choice({choice.name}));
  if (after.now != value) {
    return fail(Errc::kUnavailable,
                "{}: the camera stays at {}; turn its mode dial to M (manual) and switch every "
                "automatic off",
                doing,
                after.now);
  }
  return {};
}

void GphotoLink::forget_events() {
  // More than an endless stream of property changes needs, less than a wait that can be felt.
  constexpr int kMost = 64;
  for (int i = 0; i < kMost; ++i) {
    CameraEventType type = GP_EVENT_TIMEOUT;
    void* data = nullptr;
    if (gp_camera_wait_for_event(camera_.get(), 1, &type, &data, context_.get()) < GP_OK) return;
    std::free(data);
    if (type == GP_EVENT_TIMEOUT) return;
  }
}

Result<std::vector<CameraFilePath>> GphotoLink::release(const std::string& doing,
                                                        Time& begin,
                                                        Duration patience,
                                                        Duration wait_for_raw) {
  // Not gp_camera_capture() where it can be helped: that one (2.5.30) goes on waiting when the
  // camera has refused, and of a pair it says only which file came last.
  CameraFilePath only{};
  int code = patiently([&] {
    begin = SteadyClock().now();
    const int released = gp_camera_trigger_capture(camera_.get(), context_.get());
    if (released != GP_ERROR_NOT_SUPPORTED) return released;
    return gp_camera_capture(camera_.get(), GP_CAPTURE_IMAGE, &only, context_.get());
  });
  if (code == GP_ERROR || code == GP_ERROR_CAMERA_ERROR) {
    const Error refusal = failed(doing, code).value();
    if (refusal.code == Errc::kDisconnected) return tl::unexpected<Error>(refusal);
    return fail(refusal.code,
                "{}; most often it found no focus or has too little light for it: set the lens to "
                "manual focus (MF), the dial to M, and see that a card is in it",
                refusal.what);
  }
  if (code < GP_OK) return failed(doing, code);

  std::vector<CameraFilePath> files;
  if (only.name[0] != '\0') files.push_back(only);
  bool complete = !files.empty();
  Time deadline = SteadyClock().now() + (complete ? wait_for_raw : patience);
  while (!(complete && raw_among(files) != files.end())) {
    const auto left =
        std::chrono::duration_cast<std::chrono::milliseconds>(deadline - SteadyClock().now());
    if (left.count() <= 0) break;
    CameraEventType type = GP_EVENT_TIMEOUT;
    void* data = nullptr;
    code = gp_camera_wait_for_event(
        camera_.get(), static_cast<int>(left.count()), &type, &data, context_.get());
    const std::unique_ptr<void, decltype(&std::free)> owned(data, &std::free);
    if (code < GP_OK) return failed(doing, code);
    // Over a network it does not wait at all.
    if (type == GP_EVENT_TIMEOUT) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    const bool added = type == GP_EVENT_FILE_ADDED && data != nullptr;
    if (added && is_picture(static_cast<const CameraFilePath*>(data)->name)) {
      files.push_back(*static_cast<const CameraFilePath*>(data));
    }
    if (type == GP_EVENT_CAPTURE_COMPLETE) complete = true;
    // Not every camera says when it is done: a picture, or that word, begins the last wait.
    if (added || type == GP_EVENT_CAPTURE_COMPLETE) {
      const bool has_raw = raw_among(files) != files.end();
      deadline = std::min(deadline, SteadyClock().now() + (has_raw ? kPartnerWait : wait_for_raw));
    }
  }
  if (files.empty()) {
    return fail(Errc::kTimeout,
                "{}: {}, but no picture came; try again",
                doing,
                complete ? "the camera says that it is done" : "the camera released");
  }
  return files;
}

Result<TakenFile> GphotoLink::shoot(Duration patience, Duration wait_for_raw) {
  const std::string doing = fmt::format("taking a picture with {}", address_.model);
  said_.clear();
  forget_events();
  TakenFile file;
  VENEER_ASSIGN(const std::vector<CameraFilePath> files,
                release(doing, file.begin, patience, wait_for_raw));
  const auto raw = raw_among(files);
  const CameraFilePath wanted = raw == files.end() ? files.front() : *raw;

  const auto content = make<std::unique_ptr<::CameraFile, FreeFile>>(gp_file_new);
  if (!content) return fail(Errc::kIo, "{}: no memory", doing);
  const int code = patiently([&] {
    return gp_camera_file_get(camera_.get(),
                              wanted.folder,
                              wanted.name,
                              GP_FILE_TYPE_NORMAL,
                              content.get(),
                              context_.get());
  });
  if (code < GP_OK) return failed(fmt::format("fetching {} from the camera", wanted.name), code);
  const char* data = nullptr;
  unsigned long size = 0;  // NOLINT(google-runtime-int): the library's own type
  if (gp_file_get_data_and_size(content.get(), &data, &size) < GP_OK || size == 0) {
    return fail(Errc::kBadFormat, "{}: {} came empty; take it again", doing, wanted.name);
  }
  file.name = wanted.name;
  file.bytes.assign(data, size);
  file.encoded = is_encoded(wanted.name);
  // Where that fails, the card fills; the picture is here all the same.
  for (const CameraFilePath& one : files) {
    gp_camera_file_delete(camera_.get(), one.folder, one.name, context_.get());
  }
  said_.clear();
  return file;
}

}  // namespace veneer::capture
