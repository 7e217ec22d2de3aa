// SPDX-License-Identifier: Apache-2.0
#include "simulation/materials/tracer.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/random.h"
#include "base/result.h"
#include "simulation/materials/microfacet.h"
#include "simulation/materials/relief.h"
#include "simulation/materials/solids.h"

namespace veneer::simulation {

namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr float kMinCosine = 1e-4F;  // a surface seen more edge-on than this shows nothing

// Numbers that spread a texel's paths evenly over place in the texel and first reflection: the
// steps of the additive recurrence in five dimensions, g^-1 ... g^-5 with g^6 = g + 1. Source:
// Roberts 2018, "The Unreasonable Effectiveness of Quasirandom Sequences".
constexpr std::array kSpread{0.8812714616335696,
                             0.7766393890897683,
                             0.6844301295853426,
                             0.6031687406857282,
                             0.5315553977157914};

// The part of shading that all lights share.
struct Shading {
  Eigen::Vector3f normal, view, throughput, f0;
  float cos_v, alpha, f90;
};

// Lambert's body behind the interface: pi f_r cos_l = albedo (1 - F(l)) (1 - F(v)) cos_l.
void add_body(const LightArray& lights,
              const Shading& s,
              float weight,
              float f0,
              const float* lit,
              float* __restrict out) {
  for (std::size_t i = 0; i < lights.padded(); ++i) {
    const float cos_l =
        s.normal.x() * lights.x[i] + s.normal.y() * lights.y[i] + s.normal.z() * lights.z[i];
    // lit is 0 where the light is below the surface; the clamp only keeps the power tame.
    const float transmitted = 1.0F - (f0 + (s.f90 - f0) * schlick_weight(std::max(0.0F, cos_l)));
    out[i] += weight * lit[i] * transmitted;
  }
}

// The rough interface: pi f_r cos_l = pi D V F cos_l, for the three channels at once.
void add_interface(const LightArray& lights,
                   const Shading& s,
                   const float* lit,
                   float* __restrict red,
                   float* __restrict green,
                   float* __restrict blue) {
  const float root_v = smith_root(s.cos_v, s.alpha);
  for (std::size_t i = 0; i < lights.padded(); ++i) {
    const float x = lights.x[i];
    const float y = lights.y[i];
    const float z = lights.z[i];
    const float cos_l = std::max(0.0F, s.normal.x() * x + s.normal.y() * y + s.normal.z() * z);
    const float cos_vl = s.view.x() * x + s.view.y() * y + s.view.z() * z;
    // |v + l|, at least a little where light and view oppose each other (then lit is 0).
    const float sum = std::sqrt(std::max(1e-6F, 2.0F + 2.0F * cos_vl));
    const float cos_m = (cos_l + s.cos_v) / sum;
    const float fresnel_weight = schlick_weight(std::min(1.0F, 0.5F * sum));
    const float mirror = kPi * ggx_ndf(std::min(1.0F, cos_m), s.alpha) *
                         smith_visibility(cos_l, smith_root(cos_l, s.alpha), s.cos_v, root_v) *
                         lit[i];
    red[i] += mirror * s.throughput[0] * (s.f0[0] + (s.f90 - s.f0[0]) * fresnel_weight);
    green[i] += mirror * s.throughput[1] * (s.f0[1] + (s.f90 - s.f0[1]) * fresnel_weight);
    blue[i] += mirror * s.throughput[2] * (s.f0[2] + (s.f90 - s.f0[2]) * fresnel_weight);
  }
}

// Two axes that complete a unit vector to a right-handed frame.
// Source: Duff et al. 2017, "Building an Orthonormal Basis, Revisited", JCGT 6(1).
void complete_basis(const Eigen::Vector3d& n,
                    Eigen::Vector3d& tangent,
                    Eigen::Vector3d& bitangent) {
  const double sign = std::copysign(1.0, n.z());
  const double a = -1.0 / (sign + n.z());
  const double b = n.x() * n.y() * a;
  tangent = {1.0 + sign * n.x() * n.x() * a, sign * b, -sign * n.x()};
  bitangent = {b, sign + n.y() * n.y() * a, -n.y()};
}

}  // namespace

// A point of a path, as seen from the point before it.
struct Tracer::Vertex {
  Geometry::Hit hit;
  Surface surface;
  Eigen::Vector3d normal, view;
  Eigen::Vector3f throughput;  // of the path up to here
};

Tracer::Tracer(std::shared_ptr<const Geometry> geometry, const SynthesisOptions& options)
    : options_(options), geometry_(std::move(geometry)), lights_(options.lights) {
  for (const btf::Direction& view : options.views) views_.push_back(grid_from_local(view));
}

Tracer::Tracer(const HeightField& field, const SynthesisOptions& options, Progress& progress)
    : Tracer(std::make_shared<Relief>(field), options) {
  if (!options.exact_shadows)
    shadows_.emplace(static_cast<const Relief&>(*geometry_), lights_, progress);
}

Tracer::Tracer(const BodyField& field, const SynthesisOptions& options)
    : Tracer(std::make_shared<Solids>(field), options) {}

void Tracer::trace(int texel, std::span<float> out) const {
  const std::size_t lights = lights_.count;
  VENEER_CHECK(out.size() == views_.size() * lights * 6);
  Pcg32 random(options_.seed, static_cast<std::uint64_t>(texel));
  const double cells_per_texel = static_cast<double>(geometry_->resolution()) / options_.size;
  const int column = texel % options_.size;
  const int row = texel / options_.size;
  Film film;
  for (std::size_t view = 0; view < views_.size(); ++view) {
    for (auto& channel : film) channel.assign(lights_.padded(), 0.0F);
    std::array<double, 5> start;
    for (double& coordinate : start) coordinate = random.uniform();
    for (int sample = 0; sample < options_.samples; ++sample) {
      std::array<double, 5> spread;
      for (std::size_t k = 0; k < spread.size(); ++k) {
        spread[k] = std::fmod(start[k] + kSpread[k] * sample, 1.0);
      }
      const Eigen::Vector3d place(
          (column + spread[0]) * cells_per_texel, (row + spread[1]) * cells_per_texel, 0.0);
      trace_path(place, views_[view], {spread[2], spread[3], spread[4]}, random, film);
    }
    const float share = 1.0F / static_cast<float>(options_.samples);
    for (std::size_t light = 0; light < lights; ++light) {
      for (std::size_t channel = 0; channel < 6; ++channel) {
        out[(view * lights + light) * 6 + channel] = film[channel][light] * share;
      }
    }
  }
}

void Tracer::trace_path(const Eigen::Vector3d& place,
                        const Eigen::Vector3d& view,
                        Numbers numbers,
                        Pcg32& random,
                        Film& film) const {
  Eigen::Vector3d from = place + view * ((geometry_->top() - place.z()) / view.z());
  Eigen::Vector3d direction = -view;
  Eigen::Vector3f throughput = Eigen::Vector3f::Ones();
  bool in_body = false;
  for (int depth = 0;; ++depth) {
    const auto hit = geometry_->first_hit(from, direction);
    if (!hit) return;
    Vertex vertex{*hit, geometry_->surface(*hit), geometry_->normal(*hit), -direction, throughput};
    if (vertex.normal.dot(vertex.view) < kMinCosine) return;
    add_direct_light(vertex, in_body, film);
    if (depth == options_.bounces || !scatter(vertex, in_body, direction, numbers)) return;
    for (double& number : numbers) number = random.uniform();
    throughput = vertex.throughput;
    from = geometry_->lifted(vertex.hit, vertex.normal);
  }
}

void Tracer::light_shares(const Vertex& vertex, std::span<float> lit) const {
  if (shadows_) {
    shadows_->look_up(vertex.hit, lit);
  } else {
    const Eigen::Vector3d from = geometry_->lifted(vertex.hit, vertex.normal);
    for (std::size_t i = 0; i < lights_.count; ++i) {
      const Eigen::Vector3d to_light = lights_.direction(i);
      const bool dark = vertex.normal.dot(to_light) <= 0.0 || geometry_->first_hit(from, to_light);
      lit[i] = dark ? 0.0F : 1.0F;
    }
  }
  const Eigen::Vector3f normal = vertex.normal.cast<float>();
  for (std::size_t i = 0; i < lights_.padded(); ++i) {
    const float cos_l =
        normal.x() * lights_.x[i] + normal.y() * lights_.y[i] + normal.z() * lights_.z[i];
    lit[i] *= std::max(0.0F, cos_l);
  }
}

void Tracer::add_direct_light(const Vertex& vertex, bool in_body, Film& film) const {
  const Surface& surface = vertex.surface;
  // One per thread, so that a path allocates nothing.
  thread_local std::vector<float> lit;
  lit.assign(lights_.padded(), 0.0F);
  light_shares(vertex, lit);

  const Shading shading{vertex.normal.cast<float>(),
                        vertex.view.cast<float>(),
                        vertex.throughput,
                        surface.f0,
                        static_cast<float>(vertex.normal.dot(vertex.view)),
                        surface.alpha,
                        grazing_reflectance(surface.f0)};
  const Eigen::Vector3f seen =
      Eigen::Vector3f::Ones() - fresnel(surface.f0, std::min(1.0F, shading.cos_v));
  for (int c = 0; c < 3; ++c) {
    const float weight = vertex.throughput[c] * surface.albedo[c] * seen[c];
    if (weight > 0.0F) {
      add_body(lights_,
               shading,
               weight,
               surface.f0[c],
               lit.data(),
               film[static_cast<std::size_t>(3 + c)].data());
    }
  }
  if (surface.f0.maxCoeff() > 0.0F) {
    const std::size_t first = in_body ? 3 : 0;
    add_interface(lights_,
                  shading,
                  lit.data(),
                  film[first].data(),
                  film[first + 1].data(),
                  film[first + 2].data());
  }
}

bool Tracer::scatter(Vertex& vertex,
                     bool& in_body,
                     Eigen::Vector3d& direction,
                     const Numbers& numbers) const {
  const Surface& surface = vertex.surface;
  const auto cos_v = std::min(1.0F, static_cast<float>(vertex.normal.dot(vertex.view)));
  const Eigen::Vector3f mirrored = fresnel(surface.f0, cos_v);
  const Eigen::Vector3f seen = Eigen::Vector3f::Ones() - mirrored;
  // Which way on: in proportion to about what either way reflects.
  const float by_interface = mirrored.maxCoeff();
  const float by_body = surface.albedo.cwiseProduct(seen).maxCoeff();
  if (!(by_interface + by_body > 0.0F)) return false;
  const float interface_share = by_interface / (by_interface + by_body);
  const bool choose_body = numbers[0] >= interface_share;
  const double u1 = numbers[1];
  const double u2 = numbers[2];

  Eigen::Vector3d tangent;
  Eigen::Vector3d bitangent;
  complete_basis(vertex.normal, tangent, bitangent);
  if (choose_body) {
    // Cosine-distributed (Malley's method), so Lambert's term becomes the albedo.
    const double radius = std::sqrt(u1);
    const double angle = 2.0 * std::numbers::pi * u2;
    const double up = std::sqrt(1.0 - u1);
    direction = (radius * std::cos(angle) * tangent + radius * std::sin(angle) * bitangent +
                 up * vertex.normal)
                    .normalized();
    const Eigen::Vector3f entered =
        Eigen::Vector3f::Ones() - fresnel(surface.f0, std::min(1.0F, static_cast<float>(up)));
    vertex.throughput =
        vertex.throughput.cwiseProduct(surface.albedo).cwiseProduct(seen).cwiseProduct(entered) /
        (1.0F - interface_share);
    in_body = true;
  } else {
    const Eigen::Vector3d local_view(
        vertex.view.dot(tangent), vertex.view.dot(bitangent), vertex.view.dot(vertex.normal));
    const Eigen::Vector3d facet = sample_visible_normal(local_view, surface.alpha, u1, u2);
    const double cos_facet = std::max(0.0, local_view.dot(facet));
    const Eigen::Vector3d local = 2.0 * cos_facet * facet - local_view;
    if (local.z() < kMinCosine) return false;  // into the surface: lost, as masking says
    direction =
        (local.x() * tangent + local.y() * bitangent + local.z() * vertex.normal).normalized();
    const float kept = masking_ratio(cos_v, static_cast<float>(local.z()), surface.alpha);
    vertex.throughput = vertex.throughput.cwiseProduct(
                            fresnel(surface.f0, std::min(1.0F, static_cast<float>(cos_facet)))) *
                        (kept / interface_share);
  }
  return vertex.throughput.maxCoeff() > 0.0F;
}

}  // namespace veneer::simulation
