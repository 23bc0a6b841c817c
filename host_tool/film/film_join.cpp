#include "host_tool/film/film_join.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <vector>

#include "host_tool/child/child.h"
#include "host_tool/console/files.h"
#include "host_tool/console/overwriting.h"
#include "host_tool/film/attempts.h"
#include "host_tool/film/film_encoder.h"
#include "host_tool/film/film_list.h"
#include "host_tool/film/spherical_mp4.h"
#include "protocol/base/try.h"
#include "protocol/files/open_file.h"

namespace nodal::film {
namespace {

namespace fs = std::filesystem;

/// A file of this run, which is removed at its end.
struct Temporary {
  std::string file;
  explicit Temporary(std::string name) : file(std::move(name)) { ::unlink(file.c_str()); }
  Temporary(const Temporary&) = delete;
  Temporary& operator=(const Temporary&) = delete;
  ~Temporary() {
    if (!file.empty()) ::unlink(file.c_str());
  }
};

using Words = std::vector<std::string>;

void add(Words& words, const Words& more) { words.insert(words.end(), more.begin(), more.end()); }

Words first_words() { return {"-hide_banner", "-nostats", "-v", "error", "-nostdin"}; }

Status run(const Programs& programs, Words words, const std::string& file, const std::string& folder) {
  NODAL_TRY_ASSIGN(
      const auto child,
      Child::start(
          {.program = programs.ffmpeg, .arguments = std::move(words), .writes_files = true, .folder = folder}));
  const Child::End end = child->wait();
  if (!end.good()) return fail(writing_failed(file, end, child->complaint()));
  return {};
}

/// The list for ffmpeg's concat demuxer. The names in it are ours, and relative to it.
std::string list_of(const FilmPlan& plan, const PartsFolder& parts) {
  std::string list = "ffconcat version 1.0\n";
  const FrameRate rate = plan.coding.rate;
  for (std::uint64_t segment = 0; segment < plan.segments(); ++segment) {
    const std::uint64_t frames = plan.end_of(segment) - plan.begin_of(segment);
    list += fmt::format("file {}\nduration {:.6f}\n", fs::path(parts.segment_file(plan, segment)).filename().string(),
                        static_cast<double>(frames) * rate.denominator / rate.numerator);
  }
  return list;
}

/// Whether the container holds the sound as it is coded.
bool holds(Container container, const std::string& codec) {
  constexpr std::array<std::string_view, 5> kMp4{"aac", "mp3", "ac3", "eac3", "alac"};
  if (container == Container::kMkv) return true;
  if (std::ranges::find(kMp4, codec) != kMp4.end()) return true;
  return container == Container::kMov && codec.starts_with("pcm_");
}

/// The sound as the second input; `length_s` of it.
Words sound_input(const FilmPlan& plan) {
  Words words = input_rules(plan.sound->path);
  if (plan.sound->from_s > 0) add(words, {"-ss", fmt::format("{:.6f}", plan.sound->from_s)});
  else add(words, {"-itsoffset", fmt::format("{:.6f}", -plan.sound->from_s)});
  add(words, {"-seek_timestamp", "1", "-i", file_url(plan.sound->path)});
  return words;
}

constexpr double kHeard = 0.5;  // ppm: 1.8 ms in an hour

/// The filter that makes sound of a clock that runs faster by ppm last as long as the picture: samples are computed for
/// one rate, taken for those of another, and computed for the usual one. ffmpeg's rates are whole numbers, so the pair
/// with the nearest ratio is taken: within 10^-9. `atempo` moves sounds by up to 7 ms.
std::string faster_by(double ppm) {
  constexpr int kFirst = 96000, kLast = 116000;  // twice the usual rate, so that nothing is heard of it
  const double ratio = 1 + ppm / 1e6;
  int best = kFirst;
  double least = 1;
  for (int rate = kFirst; rate <= kLast; ++rate) {
    const double error = std::abs(std::round(rate * ratio) / rate - ratio);
    if (error < least) {
      least = error;
      best = rate;
    }
  }
  return fmt::format("aresample={},asetrate={},aresample=48000", best, std::llround(best * ratio));
}

Words sound_output(const FilmPlan& plan) {
  const PlannedSound& sound = *plan.sound;
  if (sound_is_copied(plan)) {
    // Packets before the beginning would move it in containers without edit lists.
    return {"-map", "1:a:0", "-c:a", "copy", "-copypriorss:a", "0"};
  }
  Words words{"-map", "1:a:0"};
  if (std::abs(sound.ppm) >= kHeard) add(words, {"-af", faster_by(sound.ppm)});
  const bool lossless = plan.container != Container::kMp4;
  add(words, lossless ? Words{"-c:a", "pcm_s16le"} : Words{"-c:a", "aac", "-b:a", "192k"});
  add(words, {"-flags:a", "+bitexact"});
  return words;
}

Status sync(const std::string& file) {
  const Result<int> descriptor = open_descriptor_to_read(file);
  if (!descriptor) return fail(descriptor.error().in(file));
  const bool good = ::fsync(*descriptor) == 0;
  const int error = errno;
  ::close(*descriptor);
  if (good) return {};
  return fail(error == ENOSPC ? Errc::kDiskFull : Errc::kIo, fmt::format("{}: {}", file, std::strerror(error)));
}

}  // namespace

bool sound_is_copied(const FilmPlan& plan) {
  return plan.sound && std::abs(plan.sound->ppm) < kHeard && holds(plan.container, plan.sound->codec);
}

std::string missing_segments(const FilmPlan& plan, const PartsFolder& parts) {
  std::string list;
  for (std::uint64_t segment = 0; segment < plan.segments(); ++segment) {
    if (parts.has(plan, segment)) continue;
    const std::uint64_t first = segment;
    while (segment + 1 < plan.segments() && !parts.has(plan, segment + 1)) ++segment;
    list += list.empty() ? "" : ", ";
    list += first == segment ? fmt::format("{}", first) : fmt::format("{}-{}", first, segment);
  }
  return list;
}

Status join(const FilmPlan& plan, const PartsFolder& parts, const std::string& out, const Programs& programs) {
  NODAL_TRY(host::check_free(out));
  if (const std::string missing = missing_segments(plan, parts); !missing.empty()) {
    return fail(Errc::kNotReady,
                fmt::format("{}: segments are missing or damaged: {}; make them with --segments", parts.path, missing));
  }
  remove_dead_attempts(out);
  const std::string name = attempt_name(out);
  const Temporary list(fmt::format("{}/join-{}.ffconcat", parts.path, ::getpid()));
  const Temporary joined(name + ".joined");
  Temporary whole(name);
  NODAL_TRY(host::write_file(list.file, list_of(plan, parts)));
  const bool matroska = plan.container == Container::kMkv;
  const std::string absolute = fs::absolute(joined.file).string();
  const std::string length = fmt::format(
      "{:.6f}", static_cast<double>(plan.frames) * plan.coding.rate.denominator / plan.coding.rate.numerator);
  const Words exact{"-fflags", "+bitexact", "-map_metadata", "-1"};
  Words words = first_words();
  add(words, {"-protocol_whitelist", "file", "-format_whitelist", "concat,mov,mp4", "-f", "concat", "-i",
              file_url(fs::path(list.file).filename().string())});
  const bool sound_now = plan.sound && !matroska;
  if (sound_now) add(words, sound_input(plan));
  add(words, {"-map", "0:v:0", "-c:v", "copy"});
  if (plan.coding.codec == Codec::kH265) add(words, {"-tag:v", "hvc1"});
  if (sound_now) add(words, sound_output(plan));
  add(words, exact);
  add(words, {"-t", length, "-f", plan.container == Container::kMp4 ? "mp4" : "mov", "-y", file_url(absolute)});
  NODAL_TRY(run(programs, std::move(words), out, parts.path));
  Marks marks{.spherical = plan.raymap.layout == "equirectangular"};
  if (sound_now && sound_is_copied(plan)) marks.ambisonic = ambisonic_of(plan.sound->path);
  if (matroska) {
    // ffmpeg writes Matroska's Projection from what it reads in the other file.
    const Temporary marked(name + ".marked");
    NODAL_TRY(write_marked_mp4(joined.file, marked.file, marks));
    Words again = first_words();
    add(again, {"-protocol_whitelist", "file", "-format_whitelist", "mov,mp4", "-i", file_url(marked.file)});
    if (plan.sound) add(again, sound_input(plan));
    add(again, {"-map", "0:v:0", "-c:v", "copy"});
    // MOV does not say the range of FFV1's numbers.
    if (plan.coding.codec == Codec::kFfv1) add(again, {"-color_range", "pc"});
    if (plan.sound) add(again, sound_output(plan));
    add(again, exact);
    add(again, {"-t", length, "-f", "matroska", "-y", file_url(whole.file)});
    NODAL_TRY(run(programs, std::move(again), out, ""));
  } else {
    NODAL_TRY(write_marked_mp4(joined.file, whole.file, marks));
  }
  NODAL_TRY(sync(whole.file));
  if (const int error = host::rename_to_free(whole.file, out); error != 0) {
    if (error == EEXIST) return fail(host::is_there(out));
    return fail(Errc::kIo, fmt::format("{}: {}", out, std::strerror(error)));
  }
  whole.file.clear();
  return {};
}

void remove_parts(const PartsFolder& parts) {
  const auto is_segment = [](const std::string& name) {  // "seg-00012.", and then more
    const std::size_t end = name.starts_with("seg-") ? name.find_first_not_of("0123456789", 4) : std::string::npos;
    return end != std::string::npos && end >= 9 && name[end] == '.';
  };
  constexpr std::size_t kRigFile = 25;  // "rig-", 16 digits, ".json"
  const auto is_own = [&](const std::string& name) {
    return name == "plan.json" || (name.starts_with("rig-") && name.size() == kRigFile) ||
           name.starts_with("plan.json.part-") || is_segment(name) || is_list(name) ||
           (name.starts_with("join-") && name.find(".ffconcat") != std::string::npos);
  };
  std::error_code error;
  std::vector<fs::path> own;
  for (fs::directory_iterator entry(parts.path, error), end; !error && entry != end; entry.increment(error)) {
    std::error_code unknown;
    if (entry->is_regular_file(unknown) && is_own(entry->path().filename().string())) own.push_back(entry->path());
  }
  for (const fs::path& file : own) fs::remove(file, error);
  fs::remove(parts.path, error);  // fails, as it should, if something else is in it
}

}  // namespace nodal::film
