// The skeletons of a take: a file for each performer, and the operations of an edited take.
import { readOperations } from './bend';
import { fetchJson, fetchText, NotFetched } from './request';
import { MAX_SKELETON_BYTES, parseSkeleton, type Pose, type Skeleton } from './skeleton_file';

export interface PerformerSkeleton extends Skeleton {
  /** 1 for the only one. */
  performer: number;
  at: Map<number, Pose>;
}

export interface SkeletonSet {
  skeletons: PerformerSkeleton[];
  /** Null: the take is not edited. */
  operations: unknown[] | null;
  /** What is wrong with the files, a sentence for each. */
  troubles: string[];
}

export const NO_SKELETONS: SkeletonSet = { skeletons: [], operations: null, troubles: [] };

/** v3dctl edit bends the skeleton of skeleton.json only. */
export const canBend = (first: PerformerSkeleton | undefined) => first?.performer === 1 && first.skins.length > 0;

const fileOf = (performer: number) => (performer === 1 ? 'skeleton.json' : `skeleton.performer${performer}.json`);

/** The performers that have a skeleton. Throws NotFetched. */
async function fetchPerformers(folder: string): Promise<number[]> {
  const url = new URL(`../../api/takes/${folder.split('/').at(-2)}/skeletons`, folder).href;
  return (await fetchJson<{ performers: number[] }>(url, { cache: 'no-cache' }))?.performers ?? [];
}

/** `folder`: the URL of the take. Throws NotFetched while a file cannot be fetched. */
export async function fetchSkeletons(folder: string): Promise<SkeletonSet> {
  const set: SkeletonSet = { skeletons: [], operations: null, troubles: [] };
  /** Null: there is no such file, or it is invalid. */
  const read = async <T>(file: string, parse: (text: string) => T): Promise<T | null> => {
    try {
      const text = await fetchText(folder + file, MAX_SKELETON_BYTES);
      return text === null ? null : parse(text);
    } catch (error) {
      if (error instanceof NotFetched) throw error;
      set.troubles.push(`${file}: ${(error as Error).message}`);
      return null;
    }
  };
  for (const performer of await fetchPerformers(folder)) {
    const skeleton = await read(fileOf(performer), parseSkeleton);
    if (skeleton) set.skeletons.push({ ...skeleton, performer, at: new Map(skeleton.poses.map((pose) => [pose.pulse, pose])) });
  }
  if (canBend(set.skeletons[0])) set.operations = await read('edit.json', readOperations);
  return set;
}
