// The manifest of a delivery, manifest.json (docs/export.md, "Delivery with video").
import { parseJson, type Field } from './json_field';

export const MAX_MANIFEST_BYTES = 1 << 20;
const MAX_PULSES = 1e7;
const MAX_SEGMENTS = 4096;
const MAX_VERTICES = 524_288;
const MAX_TRIANGLES = 1_048_576;

export interface VideoChoice {
  file: string;
  /** Media type with codecs, for HTMLMediaElement.canPlayType(). */
  type: string;
}

export interface ManifestSegment {
  firstPulse: number;
  lastPulse: number;
  /** Name of the GLB file. */
  surface: string;
  /** Of the surface in the motion file; null: not stated. */
  vertices: number | null;
  triangles: number | null;
}

export interface Manifest {
  take: string;
  rate: number;
  firstPulse: number;
  pulses: number;
  motion: string;
  side: number;
  /** The preferred one first. */
  videos: VideoChoice[];
  /** True: the videos have sound. */
  hasSound: boolean;
  /** Ascending, without overlap. */
  segments: ManifestSegment[];
}

const listOf = (field: Field, max: number): Field[] => {
  const list = field.list();
  return list.length >= 1 && list.length <= max ? list : field.reject(`expected a list of 1 to ${max} entries`);
};

function videoOf(field: Field): VideoChoice {
  field.expectObject();
  return { file: field.at('file').fileName(), type: field.at('type').text() };
}

function segmentOf(field: Field, from: number, end: number): ManifestSegment {
  field.expectObject();
  const firstPulse = field.at('first_pulse').integer(from, end - 1);
  return {
    firstPulse,
    lastPulse: field.at('last_pulse').integer(firstPulse, end - 1),
    surface: field.at('surface').fileName(),
    vertices: field.find('vertices')?.integer(1, MAX_VERTICES) ?? null,
    triangles: field.find('triangles')?.integer(1, MAX_TRIANGLES) ?? null,
  };
}

/** Throws one line, without the name of the file: where, and what would be right. */
export function parseManifest(text: string): Manifest {
  const field = parseJson(text);
  field.expectObject();
  if (field.at('format').value !== 'v3d-volume') field.at('format').reject('expected "v3d-volume"');
  if (field.at('version').value !== 1) field.at('version').reject('expected 1, the version that this player knows');
  const firstPulse = field.at('first_pulse').integer(0, Number.MAX_SAFE_INTEGER - MAX_PULSES);
  const pulses = field.at('pulses').integer(1, MAX_PULSES);
  const texture = field.at('texture');
  texture.expectObject();
  const segments: ManifestSegment[] = [];
  for (const entry of listOf(field.at('segments'), MAX_SEGMENTS)) {
    const from = segments.length ? segments[segments.length - 1].lastPulse + 1 : firstPulse;
    segments.push(segmentOf(entry, from, firstPulse + pulses));
  }
  field.find('sound')?.expectObject();
  return {
    take: field.find('take')?.text() ?? '',
    rate: field.at('rate_hz').positive(),
    firstPulse,
    pulses,
    motion: field.at('motion').fileName(),
    side: texture.at('side').integer(2, 16384),
    videos: listOf(texture.at('videos'), 16).map(videoOf),
    hasSound: field.find('sound') !== null,
    segments,
  };
}
