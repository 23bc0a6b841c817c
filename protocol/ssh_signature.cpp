#include "protocol/ssh_signature.h"

#include <fmt/format.h>

#include <openssl/evp.h>

#include <algorithm>
#include <memory>
#include <optional>

#include "protocol/base/text.h"
#include "protocol/base/try.h"

namespace nodal {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::string_view kBegin = "-----BEGIN SSH SIGNATURE-----";
constexpr std::string_view kEnd = "-----END SSH SIGNATURE-----";
constexpr std::string_view kSignatureMagic = "SSHSIG";
constexpr std::string_view kEd25519 = "ssh-ed25519";
constexpr std::uint32_t kVersion = 1;
constexpr std::size_t kEd25519SignatureBytes = 64;

std::string_view text_of(std::span<const std::uint8_t> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// Decodes Base64 without white space in its one canonical form (RFC 4648 sections 3.5 and 4); nothing otherwise.
std::optional<Bytes> from_base64(std::string_view text) {
  if (text.empty() || text.size() % 4 != 0) return std::nullopt;
  Bytes bytes(text.size() / 4 * 3);
  const int decoded =
      EVP_DecodeBlock(bytes.data(), reinterpret_cast<const unsigned char*>(text.data()), static_cast<int>(text.size()));
  if (decoded != static_cast<int>(bytes.size())) return std::nullopt;
  const std::size_t padding = text.ends_with("==") ? 2 : text.ends_with('=') ? 1 : 0;
  bytes.resize(bytes.size() - padding);
  // Unused bits of the padding must be zero, so that every signature has exactly one form.
  std::string again(text.size() + 1, '\0');
  EVP_EncodeBlock(reinterpret_cast<unsigned char*>(again.data()), bytes.data(), static_cast<int>(bytes.size()));
  if (std::string_view(again).substr(0, text.size()) != text) return std::nullopt;
  return bytes;
}

/// Reads SSH's numbers and strings: big-endian, strings with their length first (RFC 4251 section 5).
class SshReader {
 public:
  explicit SshReader(std::span<const std::uint8_t> bytes) : rest_(bytes) {}
  std::uint32_t number() {
    const auto four = take(4);
    std::uint32_t value = 0;
    for (const std::uint8_t byte : four) value = value << 8 | byte;
    return value;
  }
  std::span<const std::uint8_t> string() { return take(number()); }
  std::span<const std::uint8_t> take(std::size_t n) {
    if (n > rest_.size()) {
      ok_ = false;
      rest_ = {};
      return {};
    }
    const auto taken = rest_.first(n);
    rest_ = rest_.subspan(n);
    return taken;
  }
  bool complete() const { return ok_ && rest_.empty(); }

 private:
  std::span<const std::uint8_t> rest_;
  bool ok_ = true;
};

void append_string(Bytes& to, std::span<const std::uint8_t> bytes) {
  const auto n = static_cast<std::uint32_t>(bytes.size());
  for (int shift = 24; shift >= 0; shift -= 8) to.push_back(static_cast<std::uint8_t>(n >> shift));
  to.insert(to.end(), bytes.begin(), bytes.end());
}

/// The N bytes of an "ssh-ed25519" blob: a key's 32 or a signature's 64 (RFC 8709 sections 4 and 6).
template <std::size_t N>
Result<std::array<std::uint8_t, N>> ed25519_part(std::span<const std::uint8_t> blob) {
  SshReader reader(blob);
  const auto kind = reader.string();
  if (text_of(kind) != kEd25519) {
    return fail(Errc::kUnsupported,
                "it is of the kind '" + printable(text_of(kind), 40) + "'; only ssh-ed25519 keys are supported");
  }
  const auto part = reader.string();
  if (!reader.complete() || part.size() != N) return fail(Errc::kBadFormat, "it is not a whole ssh-ed25519 key");
  std::array<std::uint8_t, N> out{};
  std::copy(part.begin(), part.end(), out.begin());
  return out;
}

Result<Bytes> unarmour(std::string_view armoured) {
  const auto damaged = [] {
    return fail(Errc::kBadFormat, "the signature is damaged or not one of `ssh-keygen -Y sign`");
  };
  if (armoured.size() > kMaxSignatureBytes) {
    return fail(Errc::kTooLarge, fmt::format("the signature has over {} bytes", kMaxSignatureBytes));
  }
  const std::size_t begin = armoured.find(kBegin);
  const std::size_t end = armoured.find(kEnd);
  if (begin != 0 || end == std::string_view::npos || end < kBegin.size()) return damaged();
  std::string base64(armoured.substr(kBegin.size(), end - kBegin.size()));
  std::erase_if(base64, [](char c) { return c == '\n' || c == '\r'; });
  auto bytes = from_base64(base64);
  if (!bytes) return damaged();
  return std::move(*bytes);
}

std::optional<Bytes> digest(std::span<const std::uint8_t> document, std::string_view algorithm) {
  const EVP_MD* const kind = algorithm == "sha512" ? EVP_sha512() : algorithm == "sha256" ? EVP_sha256() : nullptr;
  if (kind == nullptr) return std::nullopt;
  Bytes hash(EVP_MAX_MD_SIZE);
  unsigned size = 0;
  NODAL_ASSERT(EVP_Digest(document.data(), document.size(), hash.data(), &size, kind, nullptr) == 1);
  hash.resize(size);
  return hash;
}

bool ed25519_verifies(std::span<const std::uint8_t> key, std::span<const std::uint8_t> signature,
                      std::span<const std::uint8_t> message) {
  const std::unique_ptr<EVP_PKEY, decltype(&EVP_PKEY_free)> public_key(
      EVP_PKEY_new_raw_public_key(EVP_PKEY_ED25519, nullptr, key.data(), key.size()), &EVP_PKEY_free);
  const std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context(EVP_MD_CTX_new(), &EVP_MD_CTX_free);
  return public_key && context &&
         EVP_DigestVerifyInit(context.get(), nullptr, nullptr, nullptr, public_key.get()) == 1 &&
         EVP_DigestVerify(context.get(), signature.data(), signature.size(), message.data(), message.size()) == 1;
}

/// The next word of a line, up to white space; quoted parts may contain white space.
std::string_view take_word(std::string_view& line) {
  line.remove_prefix(std::min(line.find_first_not_of(" \t"), line.size()));
  bool quoted = false;
  std::size_t n = 0;
  for (; n < line.size() && (quoted || (line[n] != ' ' && line[n] != '\t')); ++n) quoted ^= line[n] == '"';
  const std::string_view word = line.substr(0, n);
  line.remove_prefix(n);
  return word;
}

std::string unquoted(std::string_view word) {
  std::string text(word);
  std::erase(text, '"');
  return text;
}

std::vector<std::string> split_at_commas(const std::string& text) {
  std::vector<std::string> parts(1);
  for (const char c : text) {
    if (c == ',') parts.emplace_back();
    else parts.back() += c;
  }
  return parts;
}

}  // namespace

Result<AllowedSigners::Signer> AllowedSigners::parse_line(std::string_view line) {
  constexpr std::string_view kNamespaces = "namespaces=";
  Signer signer;
  signer.principals = unquoted(take_word(line));
  std::string_view word = take_word(line);
  if (word.starts_with(kNamespaces)) {
    signer.namespaces = split_at_commas(unquoted(word.substr(kNamespaces.size())));
    word = take_word(line);
  }
  if (word != kEd25519) {
    return fail(Errc::kUnsupported, "\"" + printable(word, 60) +
                                        "\" is neither namespaces=\"...\" nor ssh-ed25519; "
                                        "other options and kinds of keys are not supported");
  }
  const auto blob = from_base64(take_word(line));
  if (!blob) return fail(Errc::kBadFormat, "the key is missing or not base64");
  const auto key = ed25519_part<32>(*blob);
  if (!key) return fail(key.error().in("the key"));
  signer.key = *key;
  return signer;
}

Result<AllowedSigners> AllowedSigners::parse(std::string_view text) {
  if (text.size() > kMaxAllowedSignersBytes) {
    return fail(Errc::kTooLarge, fmt::format("has over {} bytes", kMaxAllowedSignersBytes));
  }
  AllowedSigners signers;
  for (int number = 1; !text.empty(); ++number) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (line.ends_with('\r')) line.remove_suffix(1);
    line.remove_prefix(std::min(line.find_first_not_of(" \t"), line.size()));
    if (line.empty() || line.front() == '#') continue;
    auto signer = parse_line(line);
    if (!signer) return fail(signer.error().in(fmt::format("line {}", number)));
    if (signers.signers_.size() == kMaxSigners) {
      return fail(Errc::kTooLarge, fmt::format("has over {} signers", kMaxSigners));
    }
    signers.signers_.push_back(std::move(*signer));
  }
  if (signers.signers_.empty()) return fail(Errc::kBadFormat, "has no signer; no calibration could ever be accepted");
  return signers;
}

Result<AllowedSigners::Verified> AllowedSigners::verify(std::span<const std::uint8_t> document,
                                                        std::string_view signature, std::string_view purpose) const {
  if (signature.empty()) return fail(Errc::kBadValue, "it is not signed");
  NODAL_TRY_ASSIGN(const auto blob, unarmour(signature));
  SshReader reader(blob);
  const bool ours = text_of(reader.take(kSignatureMagic.size())) == kSignatureMagic && reader.number() == kVersion;
  const auto key_blob = reader.string();
  const auto signed_for = reader.string();
  const auto reserved = reader.string();
  const auto algorithm = reader.string();
  const auto signature_blob = reader.string();
  if (!ours || !reader.complete()) return fail(Errc::kBadFormat, "the signature is damaged");
  const auto key = ed25519_part<32>(key_blob);
  if (!key) return fail(key.error().in("the signature's key"));
  const auto raw = ed25519_part<kEd25519SignatureBytes>(signature_blob);
  if (!raw) return fail(raw.error().in("the signature"));
  const std::string_view name_space = text_of(signed_for);
  if (name_space != purpose && !name_space.starts_with(std::string(purpose) + ":")) {
    return fail(Errc::kBadValue, "it is signed for the namespace '" + printable(name_space, 100) + "', not for '" +
                                     std::string(purpose) + "'");
  }
  const auto trusts = [&](const std::string& allowed) {
    return allowed == purpose || allowed == name_space || allowed == std::string(purpose) + "*";
  };
  const auto signer = std::ranges::find_if(signers_, [&](const Signer& one) {
    return one.key == *key && (one.namespaces.empty() || std::ranges::any_of(one.namespaces, trusts));
  });
  if (signer == signers_.end()) {
    return fail(Errc::kBadValue, "it is signed with a key that this rig's allowed signers do not have");
  }
  const auto hash = digest(document, text_of(algorithm));
  if (!hash) return fail(Errc::kUnsupported, "the signature's hash is neither sha256 nor sha512");
  Bytes message(kSignatureMagic.begin(), kSignatureMagic.end());
  append_string(message, signed_for);
  append_string(message, reserved);
  append_string(message, algorithm);
  append_string(message, *hash);
  if (!ed25519_verifies(*key, *raw, message)) {
    return fail(Errc::kChecksum, "the signature is of another document, or damaged");
  }
  return Verified{signer->principals, std::string(name_space)};
}

}  // namespace nodal
