#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "base/core/text.h"
#include "base/image/image_files.h"
#include "common/data_url.h"
#include "daemon/recorded/mesh_frames.h"
#include "daemon/recorded/take_frames.h"
#include "recon/metrics/evaluation.h"
#include "recon/render/renderer.h"
#include "v3dctl/evaluate/evaluate.h"
#include "v3dctl/options.h"

namespace v3d::ctl {
namespace {

constexpr int kJpegQuality = 88;
constexpr int kSides = 4;
constexpr ImageSize kRenderingSize{300, 460};
constexpr double kHeadLight = 0.55;  // shows the shape

std::string number(double value, int digits, const char* unit = "") {
  return fmt::format("{:.{}f}{}", value, digits, unit);
}

/// A row of the table; `text_of` is the text of one column.
template <class TextOf>
std::string row(const EvaluationPage& page, const std::string& name, const TextOf& text_of) {
  std::string html = "<tr><td>" + html_escaped(name) + "</td>";
  for (const EvaluationColumn& column : page.columns) html += "<td>" + text_of(column) + "</td>";
  return html + "</tr>\n";
}

std::string truth_rows(const EvaluationPage& page) {
  const auto of_distance = [&](const char* name, double recon::SurfaceDistance::*figure,
                               int digits) {
    return row(page, name, [&](const EvaluationColumn& c) {
      return number(c.truth->distance.*figure, digits);
    });
  };
  // Empty without such parts, for instance with a single frame.
  const auto of_change = [&](const char* name, int64_t TruthReport::*frames,
                             double recon::SurfaceChange::*figure) {
    const bool any = std::ranges::any_of(
        page.columns, [&](const EvaluationColumn& c) { return (*c.truth).*frames > 0; });
    if (!any) return std::string();
    return row(page, name, [&](const EvaluationColumn& c) {
      return (*c.truth).*frames > 0 ? number(c.truth->change.*figure, 2) : "";
    });
  };
  return of_distance("accuracy (mesh to truth): median, mm",
                     &recon::SurfaceDistance::accuracy_p50_mm, 2) +
         of_distance("accuracy: 90th percentile, mm", &recon::SurfaceDistance::accuracy_p90_mm, 1) +
         of_distance("completeness (truth to mesh): median, mm",
                     &recon::SurfaceDistance::completeness_p50_mm, 2) +
         of_distance("completeness: 90th percentile, mm",
                     &recon::SurfaceDistance::completeness_p90_mm, 1) +
         of_distance("f-score at 2 mm", &recon::SurfaceDistance::f_score_2mm, 3) +
         of_distance("f-score at 5 mm", &recon::SurfaceDistance::f_score_5mm, 3) +
         of_distance("f-score at 10 mm", &recon::SurfaceDistance::f_score_10mm, 3) +
         of_distance("error of normals, degrees", &recon::SurfaceDistance::normal_error_deg, 1) +
         row(page, "f-score at 5 mm if all surface that two cameras see were right",
             [](const EvaluationColumn& c) {
               return number(c.truth->visibility.f_score_if_right_from(2), 3);
             }) +
         row(page, "pairs of intersecting triangles",
             [](const EvaluationColumn& c) { return number(c.truth->self_intersections, 0); }) +
         of_change("flicker of still surface: median, mm", &TruthReport::still_frames,
                   &recon::SurfaceChange::flicker_p50_mm) +
         of_change("flicker: 90th percentile, mm", &TruthReport::still_frames,
                   &recon::SurfaceChange::flicker_p90_mm) +
         of_change("error of moving surface: median, mm", &TruthReport::moving_frames,
                   &recon::SurfaceChange::moving_p50_mm) +
         of_change("moving: 90th percentile, mm", &TruthReport::moving_frames,
                   &recon::SurfaceChange::moving_p90_mm);
}

/// Empty without an atlas.
std::string atlas_rows(const EvaluationPage& page, size_t camera) {
  if (page.atlas_side == 0) return "";
  const auto figure = [&](const char* name, double ImageSimilarity::*value, int digits) {
    return row(page, page.held_out[camera] + ": " + name + " with a texture atlas",
               [&](const EvaluationColumn& c) {
                 const auto& atlas = c.held_out[camera].atlas;
                 return atlas ? number((*atlas).*value, digits) : "";
               });
  };
  return figure("PSNR, dB,", &ImageSimilarity::psnr_db, 2) +
         figure("SSIM", &ImageSimilarity::ssim, 3);
}

/// Empty without a true surface.
std::string true_surface_row(const EvaluationPage& page, size_t camera) {
  const auto similarity = [&](const EvaluationColumn& c) {
    return c.held_out[camera].true_surface;
  };
  const auto is_known = [&](const EvaluationColumn& c) { return similarity(c).has_value(); };
  if (std::ranges::none_of(page.columns, is_known)) return "";
  return row(page, page.held_out[camera] + ": PSNR of the true surface, dB",
             [&](const EvaluationColumn& c) {
               const auto figures = similarity(c);
               return figures ? number(figures->psnr_db, 2) : "";
             });
}

/// Cells are empty where a camera has no frame with foreground.
std::string held_out_rows(const EvaluationPage& page) {
  std::string html;
  for (size_t i = 0; i < page.held_out.size(); ++i) {
    const auto figure = [&](const char* name, int digits, const auto& value_of) {
      return row(page, page.held_out[i] + name, [&](const EvaluationColumn& c) {
        const HeldOutReport& report = c.held_out[i];
        return report.frames > 0 ? number(value_of(report), digits) : "";
      });
    };
    html += figure(": PSNR, dB", 2, [](const HeldOutReport& r) { return r.inside.psnr_db; }) +
            true_surface_row(page, i) +
            figure(": SSIM", 3, [](const HeldOutReport& r) { return r.inside.ssim; }) +
            atlas_rows(page, i) +
            figure(": silhouette, IoU", 4, [](const HeldOutReport& r) { return r.iou; });
  }
  return html;
}

/// The caption of a rendering in the view of a held-out camera.
std::string rendering_caption(const EvaluationColumn& column, size_t camera) {
  const HeldOutReport& report = column.held_out[camera];
  return report.frames > 0 ? column.name + ": " + number(report.inside.psnr_db, 2, " dB")
                           : column.name;
}

std::string table(const EvaluationPage& page) {
  std::string html = "<table><tr><th></th>";
  for (const EvaluationColumn& column : page.columns) {
    html += "<th>" + html_escaped(column.name) + "</th>";
  }
  html += "</tr>\n";
  if (!page.truth.empty()) html += truth_rows(page);
  return html + held_out_rows(page) + "</table>\n";
}

std::string figure(const Image& picture, const std::string& caption) {
  return "<figure><img alt=\"\" src=\"" + data_url(encode_jpeg(picture.view(), kJpegQuality)) +
         "\"><figcaption>" + html_escaped(caption) + "</figcaption></figure>\n";
}

/// Images of equal width in one row.
std::string image_row(const std::string& figures) {
  return "<div class=\"beside\">\n" + figures + "</div>\n";
}

std::string error_scale() {
  std::string stops;
  for (const Rgb8& c : kErrorColours) {
    stops += ", rgb(" + std::to_string(c.r) + "," + std::to_string(c.g) + "," +
             std::to_string(c.b) + ")";
  }
  return "<div class=\"scale\" style=\"background: linear-gradient(to right" + stops +
         ")\"></div>\n<div class=\"marks\"><span>0</span><span>" + number(kMaxErrorMm / 2, 0) +
         "</span><span>" + number(kMaxErrorMm, 0, " mm and more") + "</span></div>\n";
}

/// Meshes of the shown frame, by column.
std::vector<recon::CompactFrame> meshes_of(const EvaluationPage& page, int64_t frame) {
  std::vector<recon::CompactFrame> meshes;
  for (const EvaluationColumn& column : page.columns) {
    recorded::MeshFrames frames = open_meshes(column.evaluated);
    frames.enable_views(page.view_dependent);
    meshes.push_back(frames.read(frame));
  }
  return meshes;
}

std::string error_section(const EvaluationPage& page,
                          const std::vector<recon::CompactFrame>& meshes, const Mesh& truth) {
  std::string html = "<h2>Distance of the surface from the truth</h2>\n" + error_scale();
  for (size_t i = 0; i < meshes.size(); ++i) {
    std::string views;
    for (const Image& view : error_renderings(meshes[i].mesh, truth)) views += figure(view, "");
    html += "<h3>" + html_escaped(page.columns[i].name) + "</h3>\n" + image_row(views);
  }
  return html;
}

std::string photograph_and_renderings(const EvaluationPage& page,
                                      const std::vector<recon::CompactFrame>& meshes, size_t index,
                                      const RigCamera& camera,
                                      const recorded::SegmentedFrame& frame) {
  const CroppedHeldOutView view(camera, frame);
  std::string renderings, differences;
  for (size_t i = 0; i < meshes.size(); ++i) {
    const EvaluationColumn& column = page.columns[i];
    const Mesh mesh = page.view_dependent ? recorded::ViewColours(column.evaluated.take, meshes[i],
                                                                  page.view_source)
                                                .coloured_for(camera.model)
                                          : meshes[i].mesh;
    renderings += figure(view.render(mesh), rendering_caption(column, index));
    differences += figure(view.difference(mesh), column.name + ": difference");
    const auto& similarity = column.held_out[index].atlas;
    if (!similarity || mesh.triangles.empty()) continue;
    const recorded::FrameColours colours(column.evaluated.take, meshes[i]);
    const recon::TextureAtlas atlas = colours.atlas(mesh, page.atlas_side);
    renderings += figure(view.render(mesh, &atlas),
                         column.name + ", atlas: " + number(similarity->psnr_db, 2, " dB"));
    differences += figure(view.difference(mesh, &atlas), column.name + ", atlas: difference");
  }
  // Each difference is below its rendering.
  return "<h3>" + html_escaped(page.held_out[index]) + "</h3>\n" +
         image_row(figure(view.photograph(), "photograph") + renderings) +
         image_row("<figure></figure>\n" + differences);
}

std::string held_out_pictures(const EvaluationPage& page,
                              const std::vector<recon::CompactFrame>& meshes, int64_t frame) {
  recorded::TakeFrames recorded(page.columns.front().evaluated.take, page.held_out);
  const auto views = recorded.read(frame);
  std::string html =
      "<h2>Held-out cameras</h2>\n<p class=\"note\">Photograph, renderings, and "
      "their difference inside the silhouette: white for 64 grey values and more.</p>\n";
  for (size_t i = 0; i < views.size(); ++i) {
    if (!views[i] || views[i]->mask.count() == 0) continue;
    html += photograph_and_renderings(page, meshes, i, recorded.rig()[i], *views[i]);
  }
  return html;
}

/// The middle one of the frames that all columns have; empty without such a frame.
std::optional<int64_t> shown_frame(const EvaluationPage& page) {
  std::vector<int64_t> common = open_meshes(page.columns.front().evaluated).frames({});
  for (const EvaluationColumn& column : page.columns) {
    const std::vector<int64_t> frames = open_meshes(column.evaluated).frames({});
    std::erase_if(common,
                  [&](int64_t frame) { return !std::ranges::binary_search(frames, frame); });
  }
  if (common.empty()) return std::nullopt;
  return common[common.size() / 2];
}

std::string images_of(const EvaluationPage& page, int64_t shown) {
  const std::vector<recon::CompactFrame> meshes = meshes_of(page, shown);
  std::string html;
  const auto truth = page.truth.empty() ? std::nullopt : read_truth(page.truth, shown);
  if (truth) html += error_section(page, meshes, *truth);
  if (!page.held_out.empty()) html += held_out_pictures(page, meshes, shown);
  return html;
}

std::string frames_text(const EvaluationPage& page, int64_t frames, std::optional<int64_t> shown) {
  std::string text = count_of(frames, "frame");
  text += shown ? ", images of frame " + std::to_string(*shown) + "."
                : "; no images, because no frame is in all meshes.";
  if (!page.truth.empty()) text += " Distances are medians over the frames.";
  if (!page.held_out.empty()) text += " Measurements of cameras are means over the frames.";
  if (page.view_dependent) text += " Rendered in the colours for the viewpoint of the camera.";
  return text;
}

Rgb8 error_colour(double mm) {
  constexpr size_t kSteps = std::size(kErrorColours) - 1;
  const double at = std::clamp(mm / kMaxErrorMm, 0.0, 1.0) * kSteps;
  const auto step = std::min(static_cast<size_t>(at), kSteps - 1);
  const double part = at - static_cast<double>(step);
  const Rgb8 &from = kErrorColours[step], &to = kErrorColours[step + 1];
  const auto mix = [&](uint8_t a, uint8_t b) {
    return static_cast<uint8_t>(std::lround(a + part * (b - a)));
  };
  return {mix(from.r, to.r), mix(from.g, to.g), mix(from.b, to.b)};
}

}  // namespace

std::vector<Image> error_renderings(const Mesh& mesh, const Mesh& truth) {
  Mesh painted = mesh;
  painted.colours.clear();
  for (const double mm : recon::vertex_distances_mm(mesh, truth)) {
    painted.colours.push_back(error_colour(mm));
  }
  std::vector<Image> images;
  for (const CameraModel& camera :
       recon::turntable_cameras(recon::bounds_of(truth), kSides, kRenderingSize)) {
    images.push_back(recon::draw_mesh(painted, camera, {.head_light = kHeadLight}));
  }
  return images;
}

std::string evaluation_html(const EvaluationPage& page) {
  const EvaluatedMeshes& first = page.columns.front().evaluated;
  const std::string name = take::load_take_info({first.take}).name;
  const int64_t frames = std::ssize(open_meshes(first).frames({}));
  const std::optional<int64_t> shown = shown_frame(page);
  std::string html = html_head("Evaluation of " + name) + "<h1>Evaluation of " +
                     html_escaped(name) + "</h1>\n<p>" + frames_text(page, frames, shown) +
                     "</p>\n" + table(page);
  if (shown) html += images_of(page, *shown);
  return html + "</body></html>\n";
}

}  // namespace v3d::ctl
