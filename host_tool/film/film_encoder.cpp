#include "host_tool/film/film_encoder.h"

#include <fmt/format.h>

#include <utility>

#include "protocol/base/try.h"

namespace nodal::film {

Error writing_failed(const std::string& file, const Child::End& end, const std::string& complaint) {
  if (complaint.find("No space left on device") != std::string::npos) {
    return {Errc::kDiskFull, fmt::format("{}: the disk is full", file)};
  }
  return {Errc::kIo, fmt::format("{}: ffmpeg {}", file, end_of(end, complaint))};
}

Result<std::unique_ptr<FilmEncoder>> FilmEncoder::open(const Programs& programs, const Coding& coding,
                                                       const std::string& file) {
  auto encoder = std::unique_ptr<FilmEncoder>(new FilmEncoder);
  encoder->file_ = file;
  encoder->frame_bytes_ = packed_size(coding.format, coding.width, coding.height);
  NODAL_TRY_ASSIGN(
      encoder->encoder_,
      Child::start(
          {.program = programs.ffmpeg, .arguments = encoder_words(coding, file), .input = true, .writes_files = true}));
  encoder->feeder_ = std::thread([raw = encoder.get()] { raw->feed(); });
  return encoder;
}

FilmEncoder::~FilmEncoder() {
  {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
  }
  changed_.notify_all();
  encoder_->kill();
  if (feeder_.joinable()) feeder_.join();
}

void FilmEncoder::feed() {
  for (;;) {
    std::vector<std::uint8_t> frame;
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [this] { return stopped_ || ended_ || !waiting_.empty(); });
      if (stopped_ || waiting_.empty()) return;
      frame = std::move(waiting_.front());
      waiting_.pop_front();
    }
    changed_.notify_all();
    const bool written = encoder_->write(frame).has_value();
    const std::lock_guard lock(mutex_);
    spare_.push_back(std::move(frame));
    if (written) continue;
    failed_ = true;
    changed_.notify_all();
    return;
  }
}

std::vector<std::uint8_t> FilmEncoder::memory() {
  std::vector<std::uint8_t> frame;
  {
    const std::lock_guard lock(mutex_);
    if (!spare_.empty()) {
      frame = std::move(spare_.back());
      spare_.pop_back();
    }
  }
  frame.resize(frame_bytes_);
  return frame;
}

Error FilmEncoder::failure() {
  if (feeder_.joinable()) feeder_.join();
  const Child::End end = encoder_->wait();
  return writing_failed(file_, end, encoder_->complaint());
}

Status FilmEncoder::write(std::vector<std::uint8_t> frame) {
  {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return failed_ || waiting_.size() < kWaiting; });
    if (!failed_) {
      waiting_.push_back(std::move(frame));
      changed_.notify_all();
      return {};
    }
  }
  return fail(failure());
}

Status FilmEncoder::finish() {
  {
    const std::lock_guard lock(mutex_);
    ended_ = true;
  }
  changed_.notify_all();
  feeder_.join();
  encoder_->close_input();
  const Child::End end = encoder_->wait();
  if (failed_ || !end.good()) return fail(writing_failed(file_, end, encoder_->complaint()));
  return {};
}

}  // namespace nodal::film
