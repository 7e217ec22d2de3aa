// SPDX-License-Identifier: Apache-2.0
#include "btf/importers/ubo2014/header.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "btf/internal_sample_set.h"

namespace veneer::btf::ubo2014 {
namespace {

constexpr auto kMostDirections = static_cast<std::uint32_t>(internal::kMostDirections);

struct Signature {
  std::string_view text;
  Body body;
  bool extended;
  bool rotations;
};
// Longer ones before those that they begin with.
constexpr std::array kSignatures{
    Signature{"!DFMF08FCR", Body::kDecorrelatedFactors, false, true},
    Signature{"!FMF12FCER", Body::kFactors, true, true},
    Signature{"!FMF06FCR", Body::kFactors, false, true},
    Signature{"!FMF06FC", Body::kFactors, false, false},
    Signature{"!PVF06FCR", Body::kViewFactors, false, true},
    Signature{"!PVF06FC", Body::kViewFactors, false, false},
    Signature{"!BDIF06R2!", Body::kPlain, false, true},
};

Result<Signature> read_signature(BinaryReader& reader) {
  for (const Signature& signature : kSignatures) {
    const auto starts = reader.peek(signature.text.size());
    if (starts.size() == signature.text.size() &&
        std::memcmp(starts.data(), signature.text.data(), starts.size()) == 0) {
      VENEER_TRY(reader.take({signature.text.size()}, "the signature"));
      return signature;
    }
  }
  return reader.damaged(
      "it does not begin with a signature of Bonn's .btf files (!DFMF, !FMF, !PVF, !BDIF)");
}

Result<double> read_float(BinaryReader& reader, std::string_view what) {
  VENEER_ASSIGN(const auto value, reader.read<float>(what));
  return static_cast<double>(value);
}

Status read_meta(BinaryReader& reader, Header& header) {
  const std::uint64_t start = reader.position();
  VENEER_ASSIGN(const auto size, reader.read<std::uint32_t>("the header's size"));
  VENEER_ASSIGN(const auto version, reader.read<std::uint32_t>("the header's version"));
  VENEER_TRY(reader.take({3, 80}, "the texts of the measurement"));
  VENEER_ASSIGN(header.texels_per_mm, read_float(reader, "the texels per millimetre"));
  VENEER_TRY(reader.take({3, sizeof(float)}, "the colour scales"));
  if (version > 1) {
    VENEER_ASSIGN(const auto cosine, reader.read<std::uint32_t>("the cosine's flag"));
    header.cosine_included = cosine != 0;
  }
  if (version > 2) {
    VENEER_ASSIGN(const auto length, reader.read<std::uint32_t>("the description's length"));
    VENEER_TRY(reader.take({length}, "the description"));
  }
  if (version > 3) {
    VENEER_ASSIGN(const auto channels, reader.read<std::uint32_t>("the number of channels"));
    if (channels != 3)
      return reader.damaged("it has {} channels; only RGB can be imported", channels);
    for (std::uint32_t c = 0; c < channels; ++c) {
      VENEER_ASSIGN(const auto length, reader.read<std::uint32_t>("a channel's length"));
      VENEER_ASSIGN(const auto name, reader.take({length}, "a channel's name"));
      if (length > 0 && static_cast<char>(name[0]) >= '0' && static_cast<char>(name[0]) <= '9')
        return reader.damaged("its channels are wavelengths; only RGB can be imported");
    }
  }
  if (reader.position() - start != size)
    return reader.damaged("its header states {} bytes and has {}", size, reader.position() - start);
  return {};
}

Result<Direction> read_direction(BinaryReader& reader, std::string_view what) {
  VENEER_ASSIGN(const double theta, read_float(reader, what));
  VENEER_ASSIGN(const double phi, read_float(reader, what));
  // float's rounding of the horizon
  if (!std::isfinite(phi) || !(theta >= 0.0 && theta <= std::numbers::pi / 2.0 + 1e-6))
    return reader.damaged(
        "{} (theta {}, phi {} radians) does not point up from the surface", what, theta, phi);
  return direction_from_angles({theta, phi});
}

Result<std::uint32_t> read_direction_count(BinaryReader& reader, std::string_view what) {
  VENEER_ASSIGN(const auto count, reader.read<std::uint32_t>(what));
  if (count == 0 || count > kMostDirections)
    return reader.damaged("{} is {}; expected 1 to {}", what, count, kMostDirections);
  return count;
}

Status read_sampling(BinaryReader& reader, Header& header) {
  VENEER_ASSIGN(const auto views, read_direction_count(reader, "the number of views"));
  for (std::uint32_t v = 0; v < views; ++v) {
    VENEER_ASSIGN(const Direction view, read_direction(reader, "a view"));
    header.views.push_back(view);
    VENEER_ASSIGN(const auto lights, read_direction_count(reader, "the number of lights"));
    if (v > 0 && lights != header.lights.size())
      return reader.damaged("view {} has {} lights, the first {}", v, lights, header.lights.size());
    if (v > 0) {
      VENEER_TRY(reader.take({lights, 2, sizeof(float)}, "a view's lights"));
      continue;  // the same lights for every view
    }
    for (std::uint32_t l = 0; l < lights; ++l) {
      VENEER_ASSIGN(const Direction light, read_direction(reader, "a light"));
      header.lights.push_back(light);
    }
  }
  for (const auto* directions : {&header.views, &header.lights}) {
    if (const auto equal = find_equal_directions(*directions))
      return reader.damaged("{} {} and {} have the same direction",
                            directions == &header.views ? "views" : "lights",
                            equal->first,
                            equal->second);
  }
  return {};
}

}  // namespace

Result<Header> read_header(BinaryReader& reader) {
  Header header;
  VENEER_ASSIGN(const Signature signature, read_signature(reader));
  header.body = signature.body;
  header.extended = signature.extended;
  VENEER_TRY(read_meta(reader, header));
  VENEER_TRY(read_sampling(reader, header));
  VENEER_ASSIGN(header.width, reader.read<std::uint32_t>("the width"));
  VENEER_ASSIGN(header.height, reader.read<std::uint32_t>("the height"));
  constexpr std::uint64_t kMost = std::uint64_t{1} << 31U;
  if (header.texel_count() == 0 || header.texel_count() >= kMost)
    return reader.damaged("it claims {} x {} texels", header.width, header.height);
  if (header.body == Body::kPlain) {
    VENEER_ASSIGN(header.rows_per_chunk, reader.read<std::uint32_t>("the rows of a chunk"));
    VENEER_ASSIGN(header.compression, reader.read<std::uint8_t>("the compression"));
    if (header.rows_per_chunk == 0) return reader.damaged("its chunks have no rows");
    VENEER_ASSIGN(header.mask, reader.take({header.texel_count()}, "the mask"));
  }
  if (signature.rotations) {
    VENEER_ASSIGN(const auto count, reader.read<std::uint32_t>("the number of rotations"));
    VENEER_TRY(reader.take({count, 9, sizeof(float)}, "the rotations"));
  }
  return header;
}

}  // namespace veneer::btf::ubo2014
