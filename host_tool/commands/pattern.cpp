#include "stitch/calibration/lens/pattern.h"
#include "protocol/base/file_ending.h"
#include "protocol/base/try.h"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <cmath>

#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"
#include "host_tool/console/files.h"
#include "stitch/media/pdf_page.h"
#include "stitch/media/png_writer.h"

namespace nodal::host {
namespace {

struct PatternArgs {
  std::string out;
  std::string size = "A3";
  std::uint64_t seed = 1;
  double margin_mm = 10;
};

/// The value of --size: a paper size, or a screen size in pixels.
struct Size {
  double width_mm = 0, height_mm = 0;  ///< 0 for a screen
  calibration::PatternSpec spec;
};

Result<Size> parse_pattern_size(std::string_view text) {
  constexpr std::array kSeries{841.0, 594.0, 420.0, 297.0, 210.0, 148.0};  // the shorter sides of A0 to A5
  constexpr std::array kLonger{1189.0, 841.0, 594.0, 420.0, 297.0, 210.0};
  if (text.size() == 2 && (text[0] == 'A' || text[0] == 'a') && text[1] >= '0' && text[1] <= '5') {
    const auto n = static_cast<std::size_t>(text[1] - '0');
    return Size{kLonger[n], kSeries[n], {}};
  }
  const std::size_t cross = text.find('x');
  int width = 0, height = 0;
  if (cross != std::string_view::npos) {
    const auto number = [](std::string_view digits, int& value) {
      const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
      return error == std::errc() && end == digits.data() + digits.size();
    };
    if (number(text.substr(0, cross), width) && number(text.substr(cross + 1), height)) {
      Size size;
      size.spec.width = width;
      size.spec.height = height;
      return size;
    }
  }
  return fail(Errc::kBadValue, fmt::format("size '{}': paper A0 to A5, or a screen's pixels such as 1920x1080", text));
}

Status run_pattern(Context& context, const PatternArgs& args) {
  NODAL_TRY_ASSIGN(const Size size, parse_pattern_size(args.size));
  calibration::PatternSpec spec = size.spec;
  spec.seed = args.seed;
  NODAL_TRY_ASSIGN(const calibration::PatternRaster pattern, calibration::make_pattern(spec));
  const media::GreyRaster raster{pattern.width, pattern.height, pattern.values};
  const bool paper = size.width_mm > 0;
  const std::string about = fmt::format("nodal pattern --size {} --seed {}", args.size, args.seed);
  Result<std::vector<std::uint8_t>> bytes = fail(Errc::kInternal, "");
  if (has_ending(args.out, ".pdf")) {
    // A page for a screen has one pixel per point; margins would only reduce the pattern.
    bytes = paper ? media::grey_pdf(raster, size.width_mm, size.height_mm, args.margin_mm, about)
                  : media::grey_pdf(raster, spec.width * 25.4 / 72, spec.height * 25.4 / 72, 0, about);
  } else if (has_ending(args.out, ".png")) {
    const double printed_mm = std::min((size.width_mm - 2 * args.margin_mm) / spec.width,
                                       (size.height_mm - 2 * args.margin_mm) / spec.height);
    const int pixels_per_meter = paper ? static_cast<int>(std::lround(1000 / printed_mm)) : 0;
    bytes = media::png_file({raster.width, raster.height, 1, 8, raster.values},
                            {SampleMeaning::srgb(), pixels_per_meter, about, {}, 6});
  } else {
    return fail(Errc::kBadValue, fmt::format("--out {}: end it in .png or .pdf", args.out));
  }
  if (!bytes) return fail(bytes.error());
  NODAL_TRY(write_file(args.out, *bytes));
  context.console().document({{"out", args.out},
                              {"width", spec.width},
                              {"height", spec.height},
                              {"seed", args.seed},
                              {"bytes", bytes->size()}});
  context.console().line(fmt::format("wrote {}: {}x{} px{}", args.out, spec.width, spec.height,
                                     paper ? fmt::format(" on {}", args.size) : ""));
  if (paper)
    context.console().note("print it at 100 % on matt paper and mount it flat: a bent print falsifies the lens");
  return {};
}

}  // namespace

void add_pattern(CLI::App& app, CommandLine& line) {
  CLI::App* command = add_command(app, "pattern", "Make the pattern that lenses are calibrated against; needs no rig",
                                  "  nodal pattern -o pattern.pdf                     A3, to print\n"
                                  "  nodal pattern -o pattern.pdf --size A1\n"
                                  "  nodal pattern -o pattern.png --size 3840x2160    to show on a screen\n"
                                  "Every paper of the A series holds the same pattern, which `calibrate lens` knows\n"
                                  "by itself; any other is given to it with --pattern.\n");
  auto args = std::make_shared<PatternArgs>();
  command->add_option("-o,--out", args->out, "The file to write: .pdf or .png")->required()->type_name("FILE");
  command->add_option("--size", args->size, "Paper A0 to A5, or pixels as 1920x1080 (A3 when not given)")
      ->type_name("SIZE")
      ->check(checked_by(parse_pattern_size));
  command->add_option("--seed", args->seed, "Another pattern for another number (1 when not given)")->type_name("N");
  command->add_option("--margin", args->margin_mm, "White around it on paper, in mm (10 when not given)")
      ->type_name("MM")
      ->check(CLI::Range(0.0, 100.0));
  line.on(command, [args](Context& context) { return run_pattern(context, *args); });
}

}  // namespace nodal::host
