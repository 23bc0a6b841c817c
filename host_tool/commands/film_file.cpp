#include "host_tool/commands/film_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <optional>
#include <span>
#include <vector>

#include "host_tool/console/overwriting.h"
#include "protocol/base/try.h"
#include "protocol/base/version.h"
#include "protocol/files/open_file.h"
#include "protocol/take/limits.h"
#include "protocol/take/matroska_writer.h"

namespace nodal::host {

struct FilmFile::State {
  std::string name;
  int fd = -1;
  std::optional<take::MatroskaWriter> writer;  ///< once the first frame is there
  int width = 0, height = 0;
  bool live = true;  ///< no offset was set
  std::optional<std::int64_t> utc_offset_ns;
  std::uint64_t first_ns = 0;
  std::int64_t newest_ns = 0;
  std::uint64_t frames = 0;
  /// The frames of the next cluster.
  struct Frame {
    Duration since_start;
    std::vector<std::uint8_t> bytes;
  };
  std::vector<Frame> open;
  std::size_t open_bytes = 0;
  bool created = false;  ///< there was no file of that name
  bool ended = false;

  /// Nothing if it is not known, or before 1970.
  std::optional<std::int64_t> utc_of(std::uint64_t frame_ns) const {
    using std::chrono::duration_cast, std::chrono::nanoseconds, std::chrono::system_clock;
    if (live) return duration_cast<nanoseconds>(system_clock::now().time_since_epoch()).count();
    if (!utc_offset_ns) return std::nullopt;
    const __int128 utc = static_cast<__int128>(*utc_offset_ns) + frame_ns;
    if (utc < 0 || utc > take::kMaxUtcNs) return std::nullopt;
    return static_cast<std::int64_t>(utc);
  }

  Status write_cluster() {
    if (open.empty()) return {};
    std::vector<take::Block> blocks;
    for (const Frame& each : open) blocks.push_back({each.since_start, each.bytes});
    Status written;
    for (const auto& piece : writer->cluster(blocks).pieces) {
      if (written) written = write(piece);
    }
    open.clear();
    open_bytes = 0;
    return written;
  }

  Status write(std::span<const std::uint8_t> bytes, std::optional<std::uint64_t> at = std::nullopt) {
    while (!bytes.empty()) {
      const ssize_t n = at ? ::pwrite(fd, bytes.data(), bytes.size(), static_cast<off_t>(*at))
                           : ::write(fd, bytes.data(), bytes.size());
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) {
        return fail(Errc::kIo,
                    fmt::format("{}: {}; it plays up to about frame {}", name, std::strerror(errno), frames));
      }
      bytes = bytes.subspan(static_cast<std::size_t>(n));
      if (at) *at += static_cast<std::uint64_t>(n);
    }
    return {};
  }
};

FilmFile::FilmFile(std::unique_ptr<State> state) : state_(std::move(state)) {}

FilmFile::~FilmFile() {
  (void)end();
  ::close(state_->fd);
  if (state_->created && !state_->writer) ::unlink(state_->name.c_str());
}

Result<std::unique_ptr<FilmFile>> FilmFile::create(const std::string& name) {
  auto state = std::make_unique<State>();
  state->name = name;
  std::error_code unknown;
  state->created = !std::filesystem::exists(name, unknown);
  NODAL_TRY(check_free(name));
  if (state->created) {
    const Result<FilePtr> made = create_to_write(name);
    if (!made) return fail(made.error().code == Errc::kExists ? is_there(name) : made.error().in(name));
    state->fd = ::fcntl(::fileno(made->get()), F_DUPFD_CLOEXEC, 0);
  } else {
    const Result<int> opened = open_descriptor_to_write(name);
    if (!opened) return fail(opened.error().code, fmt::format("{}: {}", name, opened.error().message));
    state->fd = *opened;
  }
  if (state->fd < 0) return fail(Errc::kIo, fmt::format("{}: {}", name, std::strerror(errno)));
  return std::unique_ptr<FilmFile>(new FilmFile(std::move(state)));
}

Status FilmFile::add(const ReceivedRaymap& raymap) {
  const wire::RaymapHeader& header = raymap.header;
  take::VideoTrack track;
  track.width = static_cast<int>(header.width());
  track.height = static_cast<int>(header.height());
  track.equirectangular = header.layout() == "equirectangular";
  track.rate = FrameRate::make(header.rate_numerator(), header.rate_denominator());
  return add(track, header.mid_exposure_ns(), raymap.bytes);
}

Status FilmFile::add(const take::VideoTrack& track, std::uint64_t now_ns, std::span<const std::uint8_t> frame) {
  State& film = *state_;
  if (!film.writer) {
    film.width = track.width;
    film.height = track.height;
    take::VideoTrack ours = track;
    ours.writer = "nodal " NODAL_VERSION;
    ours.utc_ns = film.utc_of(now_ns);
    film.writer.emplace(ours);
    film.first_ns = now_ns;
    if (::ftruncate(film.fd, 0) != 0 && errno != EINVAL) {  // EINVAL: a device or a pipe
      return fail(Errc::kIo, fmt::format("{}: {}", film.name, std::strerror(errno)));
    }
    NODAL_TRY(film.write(film.writer->head()));
  }
  if (track.width != film.width || track.height != film.height) {
    return fail(Errc::kBadFormat, fmt::format("{}: frame {} has {}x{} pixels, and the film has {}x{}", film.name,
                                              film.frames, track.width, track.height, film.width, film.height));
  }
  constexpr std::uint64_t kLongestFilm = INT64_MAX / 4;  // 73 years
  const std::uint64_t since = now_ns > film.first_ns ? std::min(now_ns - film.first_ns, kLongestFilm) : 0;
  film.newest_ns = std::max(film.newest_ns, static_cast<std::int64_t>(since));
  ++film.frames;
  const take::Block next{Duration::nanoseconds(film.newest_ns), frame};
  if (!film.open.empty() && take::MatroskaWriter::cluster_full(film.open_bytes, film.open.front().since_start, next)) {
    NODAL_TRY(film.write_cluster());
  }
  film.open.push_back({next.since_start, {frame.begin(), frame.end()}});
  film.open_bytes += frame.size();
  return {};
}

void FilmFile::set_utc_offset(std::optional<std::int64_t> offset_ns) {
  state_->live = false;
  state_->utc_offset_ns = offset_ns;
}

Status FilmFile::end() {
  State& film = *state_;
  if (film.ended || !film.writer) return {};
  film.ended = true;
  NODAL_TRY(film.write_cluster());
  NODAL_TRY(film.write(film.writer->end()));
  return film.write(film.writer->sector(), take::MatroskaWriter::kSectorAt);
}

}  // namespace nodal::host
