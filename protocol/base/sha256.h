// SHA-256 (FIPS 180-4) of bytes, by OpenSSL. Names calibrations and checks uploads.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

struct evp_md_ctx_st;

namespace nodal {

using Sha256 = std::array<std::uint8_t, 32>;

/// 64 lower-case hexadecimal digits.
std::string to_hex(const Sha256& digest);

Sha256 sha256(std::span<const std::uint8_t> bytes);

/// The same for bytes that arrive in pieces.
class Sha256Stream {
 public:
  Sha256Stream();
  void update(std::span<const std::uint8_t> bytes);
  /// Ends the stream; call once.
  Sha256 finish();

 private:
  struct Free {
    void operator()(evp_md_ctx_st* context) const;
  };
  std::unique_ptr<evp_md_ctx_st, Free> context_;
};

}  // namespace nodal
