// The frames of one head's film, from a time on, decoded by an ffmpeg of its own.
#pragma once

#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "host_tool/child/child.h"
#include "host_tool/film/film_file.h"
#include "host_tool/film/programs.h"
#include "protocol/base/image.h"
#include "protocol/base/result.h"

namespace nodal::film {

/// A thread reads kAhead frames ahead, so that decoding goes on while frames are blended.
///
/// Threading: thread-bound; starts a thread of its own.
/// Ownership: refers to the film. A picture is valid until the next call of at().
/// Errors: those of the decoder, with the file and where in it.
class HeadFilm {
 public:
  static constexpr std::size_t kAhead = 2;

  /// Starts a decoder whose first frames are at or before `from`, one of the film's times.
  static Result<std::unique_ptr<HeadFilm>> open(const Programs& programs, const FilmFile& film, std::int64_t from);
  ~HeadFilm();
  HeadFilm(const HeadFilm&) = delete;
  HeadFilm& operator=(const HeadFilm&) = delete;

  /// The frame of this time, which is not before that of the call before. Where the decoder has no such frame, because
  /// the film is damaged, the newest one before it, or the first one: replaced() counts them.
  Result<ImageView> at(std::int64_t time);
  std::uint64_t replaced() const { return replaced_; }
  /// What the decoder said about the film, although it went on; empty: nothing. Stops the decoder.
  std::string finish();

 private:
  struct Frame {
    std::int64_t time = 0;  ///< units of the film's time base
    std::vector<std::uint8_t> bytes;
  };
  explicit HeadFilm(const FilmFile& film) : film_(film) {}
  void read_ahead();
  Status read_frames();
  Result<bool> advance();

  const FilmFile& film_;
  std::unique_ptr<Child> decoder_;
  std::uint64_t replaced_ = 0;
  std::optional<Frame> current_, coming_;

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Frame> ready_;
  std::vector<std::vector<std::uint8_t>> spare_;
  bool ended_ = false, stopped_ = false;
  Status status_;
  std::thread reader_;
};

/// The words of that decoder, for tests. `from_s`: seconds after the file's start to seek to; empty: no seek.
std::vector<std::string> decoder_words(const FilmFile& film, std::optional<double> from_s);

/// Bytes of address space that it may have.
std::uint64_t decoder_memory(const FilmFile& film);

}  // namespace nodal::film
