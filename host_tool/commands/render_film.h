// `nodal render` with a coded film: the way of heads' films, from a take.
#pragma once

#include <string>

#include "host_tool/commands/film_work.h"
#include "stitch/media/take/take_folder.h"
#include "stitch/render/take_render.h"

namespace nodal::host {

struct TakeFilmArgs {
  CodingArgs coding;
  PartsArgs parts;

  bool given() const {
    return !coding.codec.empty() || coding.quality >= 0 || !coding.preset.empty() || coding.preview ||
           !parts.segments.empty() || parts.plan || parts.join;
  }
};

/// Whether the result is coded by ffmpeg: an .mp4 or .mov; an .mkv is a film of JPEGs unless an option says more.
bool is_coded_film(const std::string& out, bool options_given);
/// The same of a command line.
bool is_coded_film(const CLI::App& render);

/// `options`: with the raymap.
Status render_film(Console& console, const media::TakeFolder& take, const render::RenderOptions& options,
                   const std::string& out, const TakeFilmArgs& args);

}  // namespace nodal::host
