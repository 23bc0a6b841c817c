#include "stitch/media/pdf_page.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>

#include "protocol/base/try.h"

namespace nodal::media {
namespace {

constexpr double kPointsPerMm = 72 / 25.4;

Result<std::string> deflated(std::span<const std::uint8_t> bytes) {
  uLongf size = compressBound(bytes.size());
  std::string out(size, '\0');
  if (compress2(reinterpret_cast<Bytef*>(out.data()), &size, bytes.data(), bytes.size(), 9) != Z_OK) {
    return fail(Errc::kInternal, "zlib could not compress the picture");
  }
  out.resize(size);
  return out;
}

/// Writes objects one after another and records their offsets for the cross-reference table (ISO 32000-1, 7.5).
class Pdf {
 public:
  void object(const std::string& body) {
    offsets_.push_back(text_.size());
    text_ += fmt::format("{} 0 obj\n{}\nendobj\n", offsets_.size(), body);
  }
  void stream(const std::string& entries, const std::string& bytes) {
    object(fmt::format("<< {} /Length {} >>\nstream\n{}\nendstream", entries, bytes.size(), bytes));
  }
  std::vector<std::uint8_t> finish() {
    const std::size_t table = text_.size();
    text_ += fmt::format("xref\n0 {}\n0000000000 65535 f \n", offsets_.size() + 1);
    for (const std::size_t offset : offsets_) text_ += fmt::format("{:010} 00000 n \n", offset);
    text_ += fmt::format("trailer\n<< /Size {} /Root 1 0 R >>\nstartxref\n{}\n%%EOF\n", offsets_.size() + 1, table);
    return {text_.begin(), text_.end()};
  }

 private:
  std::string text_ = "%PDF-1.4\n%\xE2\xE3\xCF\xD3\n";
  std::vector<std::size_t> offsets_;
};

std::string pdf_string(std::string_view text) {
  std::string out = "(";
  for (const char c : text) {
    if (c == '(' || c == ')' || c == '\\') out += '\\';
    out += c;
  }
  return out + ")";
}

}  // namespace

Result<std::vector<std::uint8_t>> grey_pdf(const GreyRaster& raster, double page_width_mm, double page_height_mm,
                                           double margin_mm, std::string_view footer) {
  const double room_x = page_width_mm - 2 * margin_mm;
  const double room_y = page_height_mm - 2 * margin_mm;
  if (!(room_x > 10 && room_y > 10)) {
    return fail(Errc::kBadValue, fmt::format("margins of {} mm leave no room on a page of {} x {} mm", margin_mm,
                                             page_width_mm, page_height_mm));
  }
  const double mm_per_px = std::min(room_x / raster.width, room_y / raster.height);
  const double width = raster.width * mm_per_px * kPointsPerMm;
  const double height = raster.height * mm_per_px * kPointsPerMm;
  const double left = (page_width_mm * kPointsPerMm - width) / 2;
  const double bottom = (page_height_mm * kPointsPerMm - height) / 2;
  NODAL_TRY_ASSIGN(const std::string pixels, deflated(raster.values));
  const std::string drawing =
      fmt::format("q {:.4f} 0 0 {:.4f} {:.4f} {:.4f} cm /P Do Q\nBT /F 6 Tf {:.4f} {:.4f} Td {} Tj ET", width, height,
                  left, bottom, left, std::max(4.0, bottom - 8), pdf_string(footer));
  Pdf pdf;
  pdf.object("<< /Type /Catalog /Pages 2 0 R >>");
  pdf.object("<< /Type /Pages /Kids [3 0 R] /Count 1 >>");
  pdf.object(
      fmt::format("<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {:.4f} {:.4f}] /Contents 4 0 R /Resources << "
                  "/XObject << /P 5 0 R >> /Font << /F << /Type /Font /Subtype /Type1 /BaseFont /Helvetica >> "
                  ">> >> >>",
                  page_width_mm * kPointsPerMm, page_height_mm * kPointsPerMm));
  pdf.stream("", drawing);
  // Printers treat sRGB grey like grey with gamma 2.2.
  pdf.stream(fmt::format("/Type /XObject /Subtype /Image /Width {} /Height {} /ColorSpace [/CalGray << /WhitePoint "
                         "[0.9505 1 1.089] /Gamma 2.2 >>] /BitsPerComponent 8 /Interpolate false /Filter /FlateDecode",
                         raster.width, raster.height),
             pixels);
  return pdf.finish();
}

}  // namespace nodal::media
