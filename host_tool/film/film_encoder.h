// Codes raymaps to a file: an ffmpeg of its own, which a thread feeds.
#pragma once

#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "host_tool/child/child.h"
#include "host_tool/film/codec.h"
#include "protocol/base/result.h"

namespace nodal::film {

/// Threading: thread-bound; starts a thread of its own.
/// Ownership: the file stays when it fails; the caller removes it.
/// Errors: kDiskFull, kIo with what ffmpeg says.
class FilmEncoder {
 public:
  static constexpr std::size_t kWaiting = 2;  ///< frames

  static Result<std::unique_ptr<FilmEncoder>> open(const Programs& programs, const Coding& coding,
                                                   const std::string& file);
  ~FilmEncoder();
  FilmEncoder(const FilmEncoder&) = delete;
  FilmEncoder& operator=(const FilmEncoder&) = delete;

  /// Memory for the next frame, from those that are coded already.
  std::vector<std::uint8_t> memory();
  /// Waits while kWaiting frames wait.
  Status write(std::vector<std::uint8_t> frame);
  /// Ends the file.
  Status finish();

 private:
  FilmEncoder() = default;
  void feed();
  Error failure();

  std::unique_ptr<Child> encoder_;
  std::string file_;
  std::size_t frame_bytes_ = 0;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::vector<std::uint8_t>> waiting_;
  std::vector<std::vector<std::uint8_t>> spare_;
  bool ended_ = false, stopped_ = false, failed_ = false;
  std::thread feeder_;
};

/// What went wrong while ffmpeg wrote `file`.
Error writing_failed(const std::string& file, const Child::End& end, const std::string& complaint);

}  // namespace nodal::film
