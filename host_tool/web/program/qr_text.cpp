#include "host_tool/web/program/qr_text.h"

#include <qrencode.h>

#include <memory>

namespace nodal::host::web {

std::string qr_text(const std::string& text) {
  const std::unique_ptr<QRcode, void (*)(QRcode*)> code(QRcode_encodeString8bit(text.c_str(), 0, QR_ECLEVEL_M),
                                                        &QRcode_free);
  if (code == nullptr) return "";
  constexpr int kQuiet = 4;
  const auto light = [&](int x, int y) {
    if (x < 0 || y < 0 || x >= code->width || y >= code->width) return true;
    return (code->data[y * code->width + x] & 1) == 0;
  };
  std::string lines;
  for (int y = -kQuiet; y < code->width + kQuiet; y += 2) {
    for (int x = -kQuiet; x < code->width + kQuiet; ++x) {
      const bool above = light(x, y), below = light(x, y + 1);
      lines += above ? (below ? "█" : "▀") : (below ? "▄" : " ");
    }
    lines += '\n';
  }
  return lines;
}

}  // namespace nodal::host::web
