#include "host_tool/film/head_film.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "host_tool/film/nut_reader.h"
#include "protocol/base/try.h"

namespace nodal::film {
namespace {

/// How much before the wanted frame the decoder seeks: frames that are shown after it but coded before it need it.
constexpr double kMarginSeconds = 0.5;

}  // namespace

std::vector<std::string> decoder_words(const FilmFile& film, std::optional<double> from_s) {
  std::vector<std::string> words{"-hide_banner",  "-nostats", "-v",       "error", "-nostdin",
                                 "-noautorotate", "-copyts",  "-threads", "2"};
  const std::vector<std::string> rules = input_rules(film.path);
  words.insert(words.end(), rules.begin(), rules.end());
  if (from_s) words.insert(words.end(), {"-ss", fmt::format("{:.6f}", *from_s)});
  words.insert(words.end(), {"-i", file_url(film.path), "-map", fmt::format("0:V:{}", film.track)});
  if (film.place) words.insert(words.end(), {"-vf", filters_of(film)});
  words.insert(words.end(), {"-fps_mode", "passthrough", "-enc_time_base",
                             fmt::format("{}/{}", film.time_base.num, film.time_base.den), "-c:v", "rawvideo",
                             "-pix_fmt", film.decoded_format, "-f", "nut", "pipe:1"});
  return words;
}

/// Libraries, stacks and arenas of threads, and 64 pictures: H.264 and H.265 keep up to 16 for reference, and each
/// thread has its own. A file that makes the decoder want more is refused by its own words instead of taking all
/// memory.
std::uint64_t decoder_memory(const FilmFile& film) {
  constexpr std::uint64_t kOwn = std::uint64_t{3} << 30, kPictures = 64, kLargestSample = 8;  // bytes a pixel
  constexpr std::uint64_t kMaxParts = 64;  // a part of a picture does not say how large that is
  const auto pixels =
      (film.place ? kMaxParts : 1) * static_cast<std::uint64_t>(film.width) * static_cast<std::uint64_t>(film.height);
  return kOwn + kPictures * kLargestSample * pixels;
}

Result<std::unique_ptr<HeadFilm>> HeadFilm::open(const Programs& programs, const FilmFile& film, std::int64_t from) {
  auto head = std::unique_ptr<HeadFilm>(new HeadFilm(film));
  std::optional<double> seek;
  const double after_first = seconds_of(from - film.times.front(), film.time_base);
  if (after_first > kMarginSeconds) seek = seconds_of(from, film.time_base) - film.file_starts_s - kMarginSeconds;
  auto child = Child::start({.program = programs.ffmpeg,
                             .arguments = decoder_words(film, seek),
                             .output = true,
                             .memory = decoder_memory(film)});
  if (!child) return fail(child.error().in(film.path));
  head->decoder_ = std::move(*child);
  head->reader_ = std::thread([raw = head.get()] { raw->read_ahead(); });
  return head;
}

HeadFilm::~HeadFilm() { finish(); }

std::string HeadFilm::finish() {
  bool whole = false;
  {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
    whole = ended_;
  }
  changed_.notify_all();
  if (!whole) decoder_->kill();
  if (reader_.joinable()) reader_.join();
  decoder_->wait();
  return decoder_->complaint();
}

void HeadFilm::read_ahead() {
  const Status status = read_frames();
  const std::lock_guard lock(mutex_);
  status_ = status;
  ended_ = true;
  changed_.notify_all();
}

Status HeadFilm::read_frames() {
  NutReader nut([this](std::span<std::uint8_t> into) { return decoder_->read(into); });
  const auto video = nut.begin();
  if (!video) return fail(video.error());
  if (video->width != film_.width || video->height != film_.height) {
    return fail(Errc::kBadFormat, fmt::format("its pictures have {}x{} pixels, and it announces {}x{}", video->width,
                                              video->height, film_.width, film_.height));
  }
  for (;;) {
    Frame frame;
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [this] { return stopped_ || ready_.size() < kAhead; });
      if (stopped_) return {};
      if (!spare_.empty()) {
        frame.bytes = std::move(spare_.back());
        spare_.pop_back();
      }
    }
    frame.bytes.resize(packed_size(film_.format, film_.width, film_.height));
    NODAL_TRY_ASSIGN(const auto time, nut.next(frame.bytes));
    if (!time) return {};
    // The unit of NUT is the film's or a fraction of it.
    const Wide exact = Wide{*time} * video->time_base.num * film_.time_base.den;
    const Wide unit = Wide{video->time_base.den} * film_.time_base.num;
    frame.time = static_cast<std::int64_t>(exact / unit);
    const std::lock_guard lock(mutex_);
    ready_.push_back(std::move(frame));
    changed_.notify_all();
  }
}

/// Whether there is a frame in coming_.
Result<bool> HeadFilm::advance() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return ended_ || !ready_.empty(); });
  if (!ready_.empty()) {
    coming_ = std::move(ready_.front());
    ready_.pop_front();
    changed_.notify_all();
    return true;
  }
  if (status_) return false;
  const Error error = status_.error();
  lock.unlock();
  // The decoder's own words say more than that its output ends.
  const Child::End end = decoder_->wait();
  const std::string complaint = decoder_->complaint();
  const bool says_more = !end.good() || error.code == Errc::kTruncated;
  const std::string what = says_more ? "ffmpeg " + end_of(end, complaint) : error.message;
  return fail(Errc::kBadFormat,
              fmt::format("{}: it cannot be decoded{}: {}", film_.path,
                          current_ ? fmt::format(" after {:.3f} s", seconds_of(current_->time, film_.time_base))
                                   : std::string(),
                          what));
}

Result<ImageView> HeadFilm::at(std::int64_t time) {
  for (;;) {
    if (!coming_ && !(current_ && current_->time >= time)) {
      NODAL_TRY(advance());
    }
    if (!coming_ || (coming_->time > time && current_)) break;
    if (current_) {
      const std::lock_guard lock(mutex_);
      spare_.push_back(std::move(current_->bytes));
    }
    current_ = std::move(coming_);
    coming_.reset();
    if (current_->time >= time) break;
  }
  if (!current_) return fail(Errc::kBadFormat, fmt::format("{}: no frame of it can be decoded", film_.path));
  if (current_->time != time) ++replaced_;
  ImageView view = packed_image(film_.format, film_.width, film_.height, std::as_const(current_->bytes).data());
  view.coding = film_.coding;
  return view;
}

}  // namespace nodal::film
