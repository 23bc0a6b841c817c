#include "host_tool/commands/render_film.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include "host_tool/console/interrupt.h"
#include "host_tool/film/take_plan.h"
#include "host_tool/film/take_source.h"
#include "protocol/base/sha256.h"
#include "protocol/base/try.h"

namespace nodal::host {
namespace {

class TakeFilm final : public FilmContent {
 public:
  TakeFilm(Console& console, const media::TakeFolder& take, render::RenderOptions options, const std::string& out,
           const CodingArgs& coding, const film::Programs& programs)
      : console_(console), take_(take), options_(std::move(options)), programs_(programs) {
    request_.raymap = options_.raymap;
    if (request_.raymap.format == PixelFormat::kNv12) request_.raymap.format = PixelFormat::kI420;  // as coded
    set_coding(request_, coding, out);
    if (options_.calibration) request_.calibration = to_hex(calibration_id(*options_.calibration));
    request_.from = options_.from;
    request_.to = options_.to;
  }

  Result<film::Json> words() override { return film::words_of(request_, take_, programs_); }

  Result<film::FilmPlan> plan(std::vector<std::string>& notes) override {
    return film::make_plan(request_, take_, programs_, notes);
  }

  Result<std::unique_ptr<film::FrameSource>> source(const film::FilmPlan& plan) override {
    bar_.emplace(console_, "compiling the blend table", 100);
    auto made = interruptible(console_, [&] {
      return film::TakeSource::make(plan, take_, options_, [this](double part) {
        if (bar_) bar_->update(static_cast<std::uint64_t>(100 * part), "");
      });
    });
    bar_.reset();
    if (!made) return fail(made.error());
    return std::move(*made);
  }

  std::string tell(const film::FilmPlan& plan, Json& document) override {
    document["take"] = take_.manifest().number;
    document["farthest_ms"] = 1000 * plan.take->farthest_s;
    return fmt::format("take {}", take_.manifest().number);
  }

 private:
  Console& console_;
  const media::TakeFolder& take_;
  const render::RenderOptions options_;
  const film::Programs& programs_;
  film::TakeRequest request_;
  std::optional<Progress> bar_;  // while the first tables are compiled
};

}  // namespace

bool is_coded_film(const std::string& out, bool options_given) {
  const auto container = film::container_of(out);
  return container && (options_given || *container != film::Container::kMkv);
}

bool is_coded_film(const CLI::App& render) {
  const CLI::Option* const out = render.get_option_no_throw("--out");
  if (out == nullptr || out->empty()) return false;
  constexpr std::array kOptions{"--codec", "--crf", "--preset", "--preview", "--plan", "--segments", "--join"};
  return is_coded_film(out->results().front(), std::ranges::any_of(kOptions, [&](const char* name) {
                         const CLI::Option* const option = render.get_option_no_throw(name);
                         return option != nullptr && !option->empty();
                       }));
}

Status render_film(Console& console, const media::TakeFolder& take, const render::RenderOptions& options,
                   const std::string& out, const TakeFilmArgs& args) {
  NODAL_TRY_ASSIGN(const film::Programs programs, film::find_programs());
  TakeFilm film(console, take, options, out, args.coding, programs);
  std::vector<std::string> notes;
  if (options.raymap.layout != "equirectangular") notes.push_back(unknown_to_viewers(options.raymap.layout));
  return make_film(console, out, args.parts, programs, film, notes);
}

}  // namespace nodal::host
