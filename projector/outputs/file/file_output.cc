// SPDX-License-Identifier: Apache-2.0
#include "projector/outputs/file/file_output.h"

#include <unistd.h>

#include <algorithm>
#include <utility>

#include "base/image_files.h"

namespace veneer::projector {
namespace {

template <class Pixel>
void fit_size(Image<Pixel>& image, int width, int height) {
  if (image.width() != width || image.height() != height) image = Image<Pixel>(width, height);
}

template <class Pixel>
void copy(ImageView<const Pixel> from, Image<Pixel>& to) {
  fit_size(to, from.width(), from.height());
  for (int y = 0; y < from.height(); ++y) std::ranges::copy(from.row(y), to.view().row(y).begin());
}

/// Whether every code of `codes` is at most `highest`.
bool all_at_most(const Image<Rgb16>& codes, std::uint32_t highest) {
  return std::ranges::all_of(codes.pixels(), [highest](const Rgb16& pixel) {
    return std::ranges::all_of(pixel, [highest](std::uint16_t code) { return code <= highest; });
  });
}

/// Applies `convert` to every code.
template <class Pixel, class Convert>
void convert_codes(const Image<Rgb16>& codes, Image<Pixel>& out, Convert convert) {
  fit_size(out, codes.width(), codes.height());
  std::ranges::transform(codes.pixels(), out.pixels().begin(), [convert](const Rgb16& pixel) {
    return Pixel{convert(pixel[0]), convert(pixel[1]), convert(pixel[2])};
  });
}

}  // namespace

Status FileOutputOptions::check() const {
  if (folder.empty()) return fail(Errc::kInvalidOption, "opening the file output: set folder");
  if (every < 1)
    return fail(Errc::kInvalidOption, "opening the file output: every is 0; choose 1 or more");
  return {};
}

Result<std::unique_ptr<FileOutput>> FileOutput::open(TomlReader& config) {
  FileOutputOptions options;
  config.read("folder", options.folder);
  config.read("every", options.every);
  config.read("target", options.target);
  VENEER_TRY(options.check());
  options.folder = config.folder() / options.folder;

  std::error_code error;
  std::filesystem::create_directories(options.folder, error);
  if (error) {
    return fail(Errc::kIo,
                "opening the file output: making the folder {}: {}",
                options.folder.string(),
                error.message());
  }
  if (::access(options.folder.c_str(), W_OK | X_OK) != 0) {
    return fail(Errc::kIo,
                "opening the file output: the folder {} cannot be written to; choose another",
                options.folder.string());
  }
  return std::unique_ptr<FileOutput>(new FileOutput(std::move(options)));
}

FileOutput::FileOutput(FileOutputOptions options)
    : options_(std::move(options)), writer_([this] { run_writer(); }) {}

FileOutput::~FileOutput() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  writer_.join();
}

std::string FileOutput::description() const {
  return fmt::format(
      "files in {}{}", options_.folder.string(), options_.target ? ", with targets" : "");
}

Status FileOutput::present(const Frame& frame) {
  Job* job = nullptr;
  {
    std::unique_lock lock(mutex_);
    if (error_) return tl::unexpected<Error>(*error_);
    if (!wants_pixels(frame.number)) return {};
    if (frame.codes.empty() || (options_.target && frame.target_xyz.empty())) {
      return fail(Errc::kBadFormat,
                  "writing frame {}: it has no {}",
                  frame.number,
                  frame.codes.empty() ? "pixels" : "target");
    }
    if (queued_ == kQueueLength) {
      ++waits_;
      changed_.wait(lock, [this] { return queued_ < kQueueLength; });
      if (error_) return tl::unexpected<Error>(*error_);
    }
    job = &jobs_[(first_ + queued_) % kQueueLength];
  }
  job->number = frame.number;
  job->bits = frame.bits;
  job->display_time = frame.display_time;
  copy(frame.codes, job->codes);
  if (options_.target) copy(frame.target_xyz, job->target);
  {
    const std::lock_guard lock(mutex_);
    ++queued_;
  }
  changed_.notify_all();
  return {};
}

Status FileOutput::finish() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return queued_ == 0; });
  if (error_) return tl::unexpected<Error>(*error_);
  return {};
}

void FileOutput::run_writer() {
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return queued_ > 0 || stop_; });
    if (queued_ == 0) return;
    const Job& job = jobs_[first_];
    if (!error_) {
      lock.unlock();
      Status written = write(job);
      lock.lock();
      if (!written) error_ = std::move(written).error();
    }
    first_ = (first_ + 1) % kQueueLength;
    --queued_;
    changed_.notify_all();
  }
}

Status FileOutput::write(const Job& job) {
  const std::filesystem::path index_path = options_.folder / "frames.jsonl";
  if (!index_.is_open()) index_.open(index_path, std::ios::binary);
  const std::string name = fmt::format("frame-{:06}.png", job.number);
  VENEER_TRY(write_codes(options_.folder / name, job));
  std::string line = fmt::format(R"({{"frame":{},"display_time_ns":{},"file":"{}")",
                                 job.number,
                                 job.display_time.time_since_epoch().count(),
                                 name);
  if (options_.target) {
    const std::string target_name = fmt::format("target-{:06}.exr", job.number);
    VENEER_TRY(write_exr(options_.folder / target_name, job.target.view(), {"X", "Y", "Z"}));
    line += fmt::format(R"(,"target":"{}")", target_name);
  }
  index_ << line << "}\n" << std::flush;
  if (!index_) {
    return fail(
        Errc::kIo, "writing {}: the system refused it; is the disk full?", index_path.string());
  }
  return {};
}

Status FileOutput::write_codes(const std::filesystem::path& path, const Job& job) {
  const std::uint32_t highest = (1U << static_cast<unsigned>(std::clamp(job.bits, 0, 16))) - 1;
  if (job.bits < 1 || job.bits > 16 || !all_at_most(job.codes, highest)) {
    return fail(Errc::kBadFormat,
                "writing frame {}: its codes do not fit {} bits, or these are not 1 to 16",
                job.number,
                job.bits);
  }
  if (job.bits == 8) {
    convert_codes(
        job.codes, scratch8_, [](std::uint16_t code) { return static_cast<std::uint8_t>(code); });
    return write_png(path, std::as_const(scratch8_).view());
  }
  convert_codes(job.codes, scratch16_, [highest](std::uint32_t code) {
    return static_cast<std::uint16_t>((code * 65535U + highest / 2) /
                                      highest);  // rounded; fits 32 bits
  });
  return write_png(path, std::as_const(scratch16_).view());
}

}  // namespace veneer::projector
