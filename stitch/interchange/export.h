// Exports calibrations to other programs' formats. What a format cannot hold is fitted, and the residual is reported in
// pixels.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"

namespace nodal::interchange {

enum class ExportFormat { kHugin, kPtgui, kVideoStitch, kSurround360, kOpenCv, kKalibr };

/// "pto", "pts", "ptv", "surround360", "opencv", "kalibr". Errors: kBadValue; the message lists these names.
Result<ExportFormat> export_format_named(std::string_view name);

struct ExportOptions {
  /// The file name of each head's picture, as written into the file; a generated name where there is none.
  std::vector<std::string> images;
  /// For formats without a pixel aspect: writes numbers for pictures that are resampled to square pixels (`aspect`
  /// times wider or higher). Otherwise the fit absorbs the aspect.
  bool square_pixels = false;
};

/// The distance of the file's lens from the calibration's, over the head's region.
struct ExportedHead {
  std::string name;
  double rms_px = 0;
  double max_px = 0;
};

struct ExportedFile {
  std::string head;  ///< name of the head, for formats with one camera per file; empty otherwise
  std::string text;
};

struct ExportResult {
  std::vector<ExportedFile> files;
  std::vector<ExportedHead> heads;
  std::vector<std::string> notes;  ///< whole sentences: what the file does not hold
};

/// Errors: those of check_calibration; kUnsupported, naming the head, for a lens that the format cannot hold at
/// all.
Result<ExportResult> export_calibration(const Calibration& calibration, ExportFormat format,
                                        const ExportOptions& options = {});

}  // namespace nodal::interchange
