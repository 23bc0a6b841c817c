// `nodal take export`: a take as one seekable film a head, and its evidence as tables.
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"
#include "host_tool/console/interrupt.h"
#include "host_tool/console/overwriting.h"
#include "host_tool/console/quantities.h"
#include "host_tool/offload/take_files.h"
#include "host_tool/output/film_file.h"
#include "protocol/base/raymap_rate.h"
#include "protocol/base/try.h"
#include "protocol/calibration.h"
#include "protocol/files/open_file.h"
#include "protocol/take/tally.h"
#include "stitch/media/gpano.h"
#include "stitch/media/take/take_folder.h"
#include "stitch/media/take/take_track.h"

namespace nodal::host {
namespace {

namespace fs = std::filesystem;

struct ExportArgs {
  std::string folder;
  std::string to;
};

/// A table as CSV (RFC 4180): names and texts of takes are quoted where they must be.
class Csv {
 public:
  /// end() returns why the file could not be made or written.
  Csv(const fs::path& file, std::string_view titles) : name_(file.string()), made_(check_free(name_)) {
    std::error_code none;
    if (made_) fs::remove(file, none);  // one that may be replaced
    if (made_) make(file);
    put(titles);
    put("\r\n");
  }
  template <class... Cells>
  void row(const Cells&... cells) {
    bool first = true;
    ((put(std::exchange(first, false) ? "" : ","), put(cell(cells))), ...);
    put("\r\n");
  }
  Status end() {
    if (!made_) return made_;
    good_ = std::fflush(out_.get()) == 0 && good_;
    out_.reset();
    if (!good_) return fail(Errc::kIo, name_ + ": cannot be written; is the disk full?");
    return {};
  }

 private:
  void make(const fs::path& file) {
    Result<FilePtr> out = create_to_write(file);
    if (out) out_ = std::move(*out);
    else made_ = fail(out.error().in(name_));
  }
  void put(std::string_view text) {
    good_ = made_ && std::fwrite(text.data(), 1, text.size(), out_.get()) == text.size() && good_;
  }
  static std::string cell(const std::string& text) {
    if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
    std::string quoted = "\"";
    for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
    return quoted + '"';
  }
  template <class Number>
  static std::string cell(const Number& number) {
    return std::to_string(number);
  }

  std::string name_;
  FilePtr out_;
  Status made_;
  bool good_ = true;
};

/// The films of a take's files: one for each head, and a further one when the format changes.
class Films {
 public:
  Films(fs::path to, const take::TakeDocument& about, std::string calibration)
      : to_(std::move(to)), about_(about), calibration_(std::move(calibration)) {}

  /// Of the files that are added next. A film has one rate, so another begins a further film.
  void begin_segment(const take::wire::Begin& begin) {
    rate_ = take::rate_of(begin, about_.rate);
    const auto a_set = static_cast<int>(std::min(2U, begin.raymaps_a_set()));
    raymaps_a_set_ = a_set == 0 ? about_.raymaps_a_set : a_set;
  }

  Status add(const take::StreamFile& from, std::uint64_t at_ns, std::span<const std::uint8_t> frame) {
    Film& film = films_[from.head ? static_cast<int>(*from.head) : -1];
    const bool same = film.stream == from.stream && film.fields_apart == from.fields_apart;
    if (!film.file || !same || !take::same_rate(film.rate, rate_)) {
      if (film.file) {
        NODAL_TRY(film.file->film().end());
      }
      ++film.part;
      std::string name = from.head ? fmt::format("cam{}", *from.head) : "raymaps";
      if (film.part > 1) name += fmt::format("-part{}", film.part);
      names_.insert(name + ".mkv");
      NODAL_TRY_ASSIGN(auto made, FilmFile::create((to_ / (name + ".mkv")).string()));
      film.file = std::move(made);
      film.file->film().set_utc_offset(about_.utc_offset_ns());
      film.stream = from.stream;
      film.fields_apart = from.fields_apart;
      film.rate = rate_;
    }
    return film.file->film().add(track_of(from), at_ns, frame);
  }
  Status end() {
    for (auto& [head, film] : films_) {
      NODAL_TRY(film.file->film().end());
    }
    return {};
  }
  const std::set<std::string>& names() const { return names_; }

 private:
  struct Film {
    std::unique_ptr<FilmFile> file;
    take::Stream stream;
    bool fields_apart = false;
    FrameRate rate;
    int part = 0;
  };
  take::VideoTrack track_of(const take::StreamFile& from) const {
    take::VideoTrack track = media::track_of(from.stream);
    track.rate = from.head ? rate_ : raymap_rate(rate_, raymaps_a_set_);
    track.fields_apart = from.fields_apart;
    track.equirectangular = !from.head && media::is_whole_sphere(about_.layout);
    if (!calibration_.empty()) track.attachments.push_back({take::kCalibrationFile, "application/json", calibration_});
    return track;
  }

  const fs::path to_;
  const take::TakeDocument& about_;
  FrameRate rate_;
  int raymaps_a_set_ = 1;
  const std::string calibration_;
  std::map<int, Film> films_;
  std::set<std::string> names_;
};

/// The raymaps of a segment belong to its file of raymaps, which is the one without a head.
Status add_raymaps(media::TakeSegment& segment, Films& films) {
  std::vector<std::uint8_t> bytes;
  for (std::size_t k = 0; k < segment.streams().size(); ++k) {
    if (segment.streams()[k].head) continue;
    for (const take::wire::Raymap& raymap : segment.evidence().raymaps) {
      NODAL_TRY(segment.read(static_cast<std::uint32_t>(k), raymap.at(), raymap.bytes(), bytes));
      const auto at = static_cast<std::uint64_t>(std::max<std::int64_t>(0, raymap.mid_exposure_ns()));
      NODAL_TRY(films.add(segment.streams()[k], at, bytes));
    }
  }
  return {};
}

/// Films and tables that are in the folder already. Errors: kExists, unless they may be replaced (--overwrite).
Result<std::vector<std::string>> films_and_tables(const fs::path& to) {
  std::vector<std::string> names;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(to, error)) {
    if (entry.path().extension() != ".mkv" && entry.path().extension() != ".csv") continue;
    names.push_back(entry.path().filename().string());
    if (check_free(entry.path().string())) continue;
    return fail(Errc::kExists,
                fmt::format("--to {}: has {} already; name another folder, or replace what is there with "
                            "--overwrite",
                            to.string(), names.back()));
  }
  if (error) return fail(Errc::kIo, fmt::format("--to {}: {}", to.string(), error.message()));
  return names;
}

Status run_export(Context& context, const ExportArgs& args) {
  watch_interrupts();
  NODAL_TRY_ASSIGN(const media::TakeFolder folder, media::TakeFolder::open(take_files(args.folder)));
  const fs::path to = args.to;
  std::error_code error;
  fs::create_directories(to, error);
  if (error) return fail(Errc::kIo, fmt::format("--to {}: {}", args.to, error.message()));
  if (fs::equivalent(to, args.folder, error)) {
    return fail(Errc::kBadValue, fmt::format("--to {}: is the take itself; name another folder", args.to));
  }
  NODAL_TRY_ASSIGN(const std::vector<std::string> before, films_and_tables(to));
  std::string calibration;
  if (folder.has(take::kCalibrationFile)) {
    NODAL_TRY_ASSIGN(const auto text, folder.text(take::kCalibrationFile, kMaxCalibrationBytes));
    calibration = text;
  }
  Films films(to, folder.about(), std::move(calibration));
  Csv sets(to / "sets.csv",
           "index,number,mid_exposure_ns,since_start_ns,genlock,pulse,spread_ns,drift_ppb,not_recorded_before");
  Csv frames(to / "frames.csv",
             "index,head,name,placeholder,offset_ns,exposure_ns,gain_mdb,red_q12,blue_q12,gamma,sequence,quality");
  Progress bar(context.console(), "exporting", folder.manifest().sets);
  media::TakeSets all(folder);
  media::TakeSet set;
  std::vector<std::uint8_t> bytes;
  std::optional<std::int64_t> first;
  std::optional<std::uint32_t> segment;
  std::uint64_t done = 0;
  for (;;) {
    NODAL_TRY_ASSIGN(const bool more, all.next(set));
    if (!more) break;
    if (interrupted()) return fail(Errc::kCancelled, fmt::format("stopped; {} is not complete", args.to));
    const take::wire::Set& stored = set.evidence;
    if (!first) first = stored.mid_exposure_ns();
    if (segment != all.segment().evidence().begin.segment()) {
      segment = all.segment().evidence().begin.segment();
      films.begin_segment(all.segment().evidence().begin);
      NODAL_TRY(add_raymaps(all.segment(), films));
    }
    sets.row(stored.index(), stored.number(), stored.mid_exposure_ns(), stored.mid_exposure_ns() - *first,
             stored.genlock(), stored.has_pulse() ? std::to_string(stored.pulse()) : std::string(), stored.spread_ns(),
             stored.has_drift_ppb() ? std::to_string(stored.drift_ppb()) : std::string(), stored.missed());
    for (const take::wire::Frame& frame : stored.frames()) {
      const take::StreamFile& file = all.segment().streams()[frame.file()];
      const std::uint32_t head = *file.head;
      frames.row(stored.index(), head, folder.about().heads[head], frame.placeholder(), frame.offset_ns(),
                 frame.exposure_ns(), frame.gain_mdb(), frame.red_q12(), frame.blue_q12(), frame.gamma(),
                 frame.sequence(), frame.quality());
      NODAL_TRY(all.segment().read(frame.file(), frame.at(), frame.bytes(), bytes));
      const auto at = static_cast<std::uint64_t>(std::max<std::int64_t>(0, stored.mid_exposure_ns()));
      NODAL_TRY(films.add(file, at, bytes));
    }
    bar.update(++done, args.to);
  }
  for (const Status& ended : {films.end(), sets.end(), frames.end()}) {
    if (!ended) return ended;
  }
  context.console().document({{"take", folder.manifest().number},
                              {"to", args.to},
                              {"sets", folder.manifest().sets},
                              {"films", films.names().size()},
                              {"tables", {"sets.csv", "frames.csv"}}});
  context.console().line(fmt::format("{}: {} with {}, sets.csv and frames.csv", args.to,
                                     counted(films.names().size(), "film"), counted(folder.manifest().sets, "set")));
  for (const std::string& name : before) {
    if (films.names().contains(name) || name == "sets.csv" || name == "frames.csv") continue;
    context.console().note(fmt::format("{}: {} was there before, and is not of this take", args.to, name));
  }
  return {};
}

}  // namespace

void add_take_export(CLI::App& group, CommandLine& line) {
  auto args = std::make_shared<ExportArgs>();
  CLI::App* command =
      add_command(group, "export", "A copy of a take as one film for each head, and its evidence as tables",
                  "  nodal take export 000042 --to bus\n"
                  "  ffplay bus/cam0.mkv\n"
                  "Pictures are copied, not coded again. Frame i of every film belongs to row i of sets.csv, from the\n"
                  "set on in which the head first delivered.\n");
  command->add_option("FOLDER", args->folder, "The folder of the take")->required()->type_name("");
  command
      ->add_option("--to", args->to,
                   "The folder to write to; it is made. Films and tables that it has are replaced with --overwrite")
      ->required()
      ->type_name("DIR");
  line.on(command, [args](Context& context) { return run_export(context, *args); });
}

}  // namespace nodal::host
