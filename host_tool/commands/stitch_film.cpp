#include "host_tool/commands/stitch_film.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <optional>

#include "host_tool/commands/film_calibration.h"
#include "host_tool/commands/film_request.h"
#include "host_tool/commands/film_work.h"
#include "host_tool/console/files.h"
#include "host_tool/console/interrupt.h"
#include "host_tool/console/quantities.h"
#include "host_tool/film/head_clocks.h"
#include "host_tool/film/heads_source.h"
#include "host_tool/film/light_plan.h"
#include "host_tool/input/calibration_file.h"
#include "host_tool/input/own_pictures.h"
#include "protocol/base/sha256.h"
#include "protocol/base/try.h"

namespace nodal::host {
namespace {

/// The films of the heads, and all that one run finds in them.
class HeadsFilm final : public FilmContent {
 public:
  HeadsFilm(Context& context, const StitchArgs& args, const FilmArgs& words)
      : console_(context.console()), args_(args), words_(words), parts_(film::parts_of(args.out)) {}

  Status run() {
    NODAL_TRY_ASSIGN(programs_, film::find_programs());
    const bool alone = films_alone(args_);
    NODAL_TRY_ASSIGN(args_.inputs, one_for_each_head(programs_, args_, words_.rate, parts_.path));
    if (alone) NODAL_TRY(find_calibration());
    NODAL_TRY_ASSIGN(request_, make_request(console_, args_, words_, found_, notes_));
    return make_film(console_, args_.out, words_.parts, programs_, *this, notes_);
  }

  Result<Json> words() override { return film::words_of(request_, programs_); }

  Result<film::FilmPlan> plan(std::vector<std::string>& notes) override {
    NODAL_TRY_ASSIGN(const auto films, probe_films(programs_, request_));
    NODAL_TRY_ASSIGN(const film::FilmRequest timed, with_times(request_, films, Lenses::kKnown));
    NODAL_TRY_ASSIGN(film::FilmPlan plan, film::make_plan(timed, films, programs_, notes));
    plan.times_residual_s = residual_s_;
    if (!request_.matched) return plan;
    Progress bar(console_, "matching the heads' light", 100);
    const auto go_on = [&](double part) {
      bar.update(static_cast<std::uint64_t>(100 * part), "");
      return !interrupted();
    };
    NODAL_TRY(film::plan_light(plan, programs_, go_on, notes));
    return plan;
  }

  Result<std::unique_ptr<film::FrameSource>> source(const film::FilmPlan& plan) override {
    Progress bar(console_, "compiling the blend table", 100);
    auto made = interruptible(console_, [&] {
      return film::HeadsSource::make(plan, programs_, args_.threads,
                                     [&](double part) { bar.update(static_cast<std::uint64_t>(100 * part), ""); });
    });
    if (!made) return fail(made.error().in(args_.inputs.front()));
    return std::move(*made);
  }

  std::string tell(const film::FilmPlan& plan, Json& document) override {
    Json heads = Json::array();
    for (const film::PlannedHead& head : plan.heads) {
      const film::HeadTime& clock = head.clock;
      heads.push_back({{"head", head.name},
                       {"film", head.film.path},
                       {"offset_s", clock.offset_s},
                       {"ppm", clock.ppm},
                       {"sigma_ms", 1000 * clock.sigma_s},
                       {"ppm_sigma", clock.ppm_sigma},
                       {"by", clock.by.empty() ? "begin" : clock.by},
                       {"farthest_ms", 1000 * head.farthest_s}});
      if (plan.light.stops.empty()) continue;
      const auto [least, most] = std::ranges::minmax(plan.light.stops[heads.size() - 1]);
      heads.back()["light_stops"] = {1.0 * least / kStop, 1.0 * most / kStop};
    }
    document["heads"] = heads;
    document["times_residual_ms"] = 1000 * plan.times_residual_s;
    if (!still_.is_null()) document["still"] = still_;
    return counted(plan.heads.size(), "head");
  }

 private:
  /// The calibration of films alone: the one that a run before has left in the folder of parts, or found in frames.
  Status find_calibration() {
    film::FilmRequest request;  // what is known before
    request.films = args_.inputs;
    request.one_file = args_.inputs.size() == 1;
    NODAL_TRY_ASSIGN(const auto words, film::words_of(request, programs_));
    const std::string identity = words["films"].dump() + args_.split;
    const std::string of_films =
        to_hex(sha256({reinterpret_cast<const std::uint8_t*>(identity.data()), identity.size()})).substr(0, 16);
    const std::string stored = fmt::format("{}/rig-{}.json", parts_.path, of_films);
    std::error_code error;
    if (std::filesystem::exists(stored, error)) {
      NODAL_TRY_ASSIGN(found_, read_calibration(stored, console_));
      return {};
    }
    if (words_.parts.join) return no_plan(parts_);
    PictureSplit split;
    std::vector<std::string> names = head_names(request.films);
    if (request.one_file) {
      NODAL_TRY_ASSIGN(const film::FilmFile whole, film::probe(programs_, args_.inputs.front()));
      if (whole.tracks == 1) {
        NODAL_TRY_ASSIGN(split, split_of_film(programs_, whole, args_.split, parts_.path));
        names = part_names(split);
      }
      request.films.resize(std::max(static_cast<std::size_t>(whole.tracks), split.count()), whole.path);
      if (whole.tracks > 1) names = head_names(request.films);
    }
    NODAL_TRY_ASSIGN(const auto films, probe_films(programs_, request, split));
    for (std::size_t h = 0; h < names.size(); ++h) {
      HeadCalibration head;
      head.name = names[h];
      head.width = films[h].width;
      head.height = films[h].height;
      request.calibration.heads.push_back(std::move(head));
    }
    request.times_by = words_.times;
    NODAL_TRY_ASSIGN(request.times, given_times(words_));
    auto timed = with_times(request, films, Lenses::kUnknown);
    if (!timed && timed.error().code != Errc::kNotDetermined) return fail(timed.error());
    if (timed && words_.times == "auto") heard_ = timed->times;
    else notes_.clear();  // it is found again, by what the user named or with known lenses
    std::vector<film::HeadTime> times;
    for (const std::string& name : names) {
      const auto& those = timed ? timed->times : request.times;
      const auto known = std::ranges::find(those, name, &film::HeadTime::head);
      times.push_back(known != those.end() ? *known : film::HeadTime{name});
    }
    NODAL_TRY_ASSIGN(const StitchedPictures still,
                     calibrate_films(console_, args_, programs_, films, names, times, timed.has_value(), parts_.path));
    found_ = still.calibration;
    still_ = still.document;
    for (const std::string& line : still.lines) console_.line(line);
    return write_file(stored, to_json(*found_));
  }

  enum class Lenses { kUnknown, kKnown };
  /// The request with every head's time. How fast pictures turn tells it only where lenses are known.
  Result<film::FilmRequest> with_times(const film::FilmRequest& request, const std::vector<film::FilmFile>& films,
                                       Lenses lenses) {
    film::FilmRequest timed = request;
    // Parts of one picture are of one instant.
    if (request.times_by == "begin" || films.front().place) return timed;
    if (heard_) {
      timed.times = *heard_;
      return timed;
    }
    film::ClockSources sources;
    if (request.times_by != "auto") sources = *film::parse_clock_sources(request.times_by);
    sources.readout_s = request.readout_s;
    if (lenses == Lenses::kUnknown) sources.rotation = sources.flash = false;
    const std::string folder = std::filesystem::absolute(args_.out).parent_path().string();
    std::string doing;
    std::optional<Progress> bar;
    auto clocks = film::find_clocks(programs_, films, request.calibration, request.times, sources, folder, notes_,
                                    [&](const std::string& what, double part) {
                                      if (what != doing) bar.emplace(console_, what, 100);
                                      doing = what;
                                      bar->update(static_cast<std::uint64_t>(100 * part), "");
                                      return !interrupted();
                                    });
    if (!clocks && clocks.error().code == Errc::kNotDetermined) {
      return fail(Errc::kNotDetermined,
                  fmt::format("{}; or --times begin, if one signal started all cameras", clocks.error().message));
    }
    if (!clocks) return fail(clocks.error());
    timed.times = std::move(clocks->times);
    residual_s_ = clocks->residual_s;
    return timed;
  }

  Console& console_;
  StitchArgs args_;
  const FilmArgs& words_;
  film::PartsFolder parts_;
  film::Programs programs_;
  film::FilmRequest request_;
  std::optional<Calibration> found_;                  // calibration that the films' frames gave
  std::optional<std::vector<film::HeadTime>> heard_;  // the heads' times, if they are known before their lenses
  Json still_;                                        // what `nodal stitch` says of these frames
  std::vector<std::string> notes_;
  double residual_s_ = 0;
};

}  // namespace

bool makes_film(const std::string& out) { return film::container_of(out).has_value(); }

Status run_film(Context& context, const StitchArgs& args, const FilmArgs& film) {
  watch_interrupts();
  return HeadsFilm(context, args, film).run();
}

}  // namespace nodal::host
