// Calibrations for other programs. What a program's file cannot hold is fitted, and the residual told in
// pixels.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"

namespace nodal::interchange {

enum class ExportFormat { kHugin, kPtgui, kVideoStitch, kSurround360, kOpenCv, kKalibr };

/// "pto", "pts", "ptv", "surround360", "opencv", "kalibr". Errors: kBadValue, with the names there are.
Result<ExportFormat> export_format_named(std::string_view name);

struct ExportOptions {
  /// Each head's picture as the file should name it; a made-up name where there is none.
  std::vector<std::string> images;
  /// For formats without a pixel aspect: numbers for pictures made `aspect` times wider, or higher, so that
  /// pixels are square. Otherwise the aspect is squeezed into the fit.
  bool square_pixels = false;
};

/// How far the file's lens is from the calibration's, over the head's region.
struct ExportedHead {
  std::string name;
  double rms_px = 0;
  double max_px = 0;
};

struct ExportedFile {
  std::string head;  ///< of a format that holds one camera a file; empty otherwise
  std::string text;
};

struct ExportResult {
  std::vector<ExportedFile> files;
  std::vector<ExportedHead> heads;
  std::vector<std::string> notes;  ///< whole sentences: what was lost
};

/// Errors: those of check_calibration; kUnsupported, naming the head, for a lens that the format cannot hold at
/// all.
Result<ExportResult> export_calibration(const Calibration& calibration, ExportFormat format,
                                        const ExportOptions& options = {});

}  // namespace nodal::interchange
